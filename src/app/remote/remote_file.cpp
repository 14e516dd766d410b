#include "app/remote/remote_file.hpp"

#include <linux/input.h>
#include <sodium.h>

#include <algorithm>
#include <sstream>

#include "config/toml_reader.hpp"

namespace equipoise::app {
namespace {

/// A key, button or axis by the kernel's name: "KEY_W", "BTN_START", "-ABS_Y".
struct EventName {
  bool axis = false;
  std::uint16_t code = 0;
  double sign = 1.0;
};

struct Known {
  const char* name;
  std::uint16_t code;
};

#define EQUIPOISE_CODE(name) \
  { #name, name }
constexpr Known kKnown[] = {
    EQUIPOISE_CODE(KEY_A),         EQUIPOISE_CODE(KEY_B),         EQUIPOISE_CODE(KEY_C),
    EQUIPOISE_CODE(KEY_D),         EQUIPOISE_CODE(KEY_E),         EQUIPOISE_CODE(KEY_F),
    EQUIPOISE_CODE(KEY_G),         EQUIPOISE_CODE(KEY_H),         EQUIPOISE_CODE(KEY_I),
    EQUIPOISE_CODE(KEY_J),         EQUIPOISE_CODE(KEY_K),         EQUIPOISE_CODE(KEY_L),
    EQUIPOISE_CODE(KEY_M),         EQUIPOISE_CODE(KEY_N),         EQUIPOISE_CODE(KEY_O),
    EQUIPOISE_CODE(KEY_P),         EQUIPOISE_CODE(KEY_Q),         EQUIPOISE_CODE(KEY_R),
    EQUIPOISE_CODE(KEY_S),         EQUIPOISE_CODE(KEY_T),         EQUIPOISE_CODE(KEY_U),
    EQUIPOISE_CODE(KEY_V),         EQUIPOISE_CODE(KEY_W),         EQUIPOISE_CODE(KEY_X),
    EQUIPOISE_CODE(KEY_Y),         EQUIPOISE_CODE(KEY_Z),         EQUIPOISE_CODE(KEY_UP),
    EQUIPOISE_CODE(KEY_DOWN),      EQUIPOISE_CODE(KEY_LEFT),      EQUIPOISE_CODE(KEY_RIGHT),
    EQUIPOISE_CODE(KEY_SPACE),     EQUIPOISE_CODE(KEY_ENTER),     EQUIPOISE_CODE(KEY_ESC),
    EQUIPOISE_CODE(KEY_TAB),       EQUIPOISE_CODE(KEY_BACKSPACE), EQUIPOISE_CODE(KEY_PAGEUP),
    EQUIPOISE_CODE(KEY_PAGEDOWN),  EQUIPOISE_CODE(KEY_HOME),      EQUIPOISE_CODE(KEY_END),
    EQUIPOISE_CODE(KEY_F1),        EQUIPOISE_CODE(KEY_F2),        EQUIPOISE_CODE(KEY_F3),
    EQUIPOISE_CODE(KEY_F4),        EQUIPOISE_CODE(BTN_TRIGGER),   EQUIPOISE_CODE(BTN_THUMB),
    EQUIPOISE_CODE(BTN_SOUTH),     EQUIPOISE_CODE(BTN_EAST),      EQUIPOISE_CODE(BTN_NORTH),
    EQUIPOISE_CODE(BTN_WEST),      EQUIPOISE_CODE(BTN_TL),        EQUIPOISE_CODE(BTN_TR),
    EQUIPOISE_CODE(BTN_TL2),       EQUIPOISE_CODE(BTN_TR2),       EQUIPOISE_CODE(BTN_SELECT),
    EQUIPOISE_CODE(BTN_START),     EQUIPOISE_CODE(BTN_MODE),      EQUIPOISE_CODE(BTN_THUMBL),
    EQUIPOISE_CODE(BTN_THUMBR),    EQUIPOISE_CODE(BTN_DPAD_UP),   EQUIPOISE_CODE(BTN_DPAD_DOWN),
    EQUIPOISE_CODE(BTN_DPAD_LEFT), EQUIPOISE_CODE(BTN_DPAD_RIGHT)};
constexpr Known kKnownAxes[] = {
    EQUIPOISE_CODE(ABS_X),     EQUIPOISE_CODE(ABS_Y),        EQUIPOISE_CODE(ABS_Z),
    EQUIPOISE_CODE(ABS_RX),    EQUIPOISE_CODE(ABS_RY),       EQUIPOISE_CODE(ABS_RZ),
    EQUIPOISE_CODE(ABS_GAS),   EQUIPOISE_CODE(ABS_BRAKE),    EQUIPOISE_CODE(ABS_HAT0X),
    EQUIPOISE_CODE(ABS_HAT0Y), EQUIPOISE_CODE(ABS_THROTTLE), EQUIPOISE_CODE(ABS_RUDDER)};
#undef EQUIPOISE_CODE

std::optional<EventName> event_named(const std::string& name) {
  const bool negative = !name.empty() && name.front() == '-';
  const std::string plain = name.substr(negative ? 1 : 0);
  for (const Known& axis : kKnownAxes)
    if (plain == axis.name) return EventName{true, axis.code, negative ? -1.0 : 1.0};
  for (const Known& key : kKnown)
    if (!negative && plain == key.name) return EventName{false, key.code, 1.0};
  return std::nullopt;
}

using config::Document;
using config::Section;

constexpr std::size_t kLongestFrame = 32;

bool is_motion(HandAction action) {
  return action >= HandAction::kForward && action <= HandAction::kTurnRight;
}

std::vector<EventBinding> event_bindings(Section& s, HandAction action, const std::string& key) {
  std::vector<EventBinding> bindings;
  std::istringstream names(s.text(key));
  for (std::string name; names >> name;) {
    const auto event = event_named(name);
    if (!event)
      s.fail(key, "\"" + name + "\" is not known; allowed: names as KEY_W, BTN_START, ABS_Y, -ABS_Y");
    if (event->axis && !is_motion(action)) s.fail(key, name + ": an axis moves and turns, nothing else");
    bindings.push_back({action, event->axis, event->code, event->sign});
  }
  return bindings;
}

std::string from_hex(const std::string& text, Section& s, const std::string& key) {
  std::array<std::uint8_t, kLongestFrame> bytes{};
  std::size_t size = 0;
  (void)sodium_hex2bin(bytes.data(), bytes.size(), text.data(), text.size(), nullptr, &size, nullptr);
  std::string frame(reinterpret_cast<const char*>(bytes.data()), size);
  if (frame.empty() || to_hex(frame) != text)
    s.fail(key, "\"" + text + "\": allowed: 1 to " + std::to_string(kLongestFrame) +
                    " bytes in hexadecimal, e.g. \"7e46\"");
  return frame;
}

void read_events(Section s, RemoteFile* out) {
  if (s.has("axis_range")) {
    const auto range = s.numbers("axis_range", 2, -1e9, 1e9);
    if (!(range[0] < range[1])) s.fail("axis_range", "allowed: the lower number first");
    out->axis_range = {static_cast<int>(range[0]), static_cast<int>(range[1])};
  }
  for (std::size_t i = 0; i < kHandActions.size(); ++i) {
    if (!s.has(kHandActions[i])) continue;
    const auto bindings = event_bindings(s, static_cast<HandAction>(i), kHandActions[i]);
    out->events.insert(out->events.end(), bindings.begin(), bindings.end());
  }
  s.finish();
}

void read_frames(Section s, RemoteFile* out) {
  for (std::size_t i = 0; i < kHandActions.size(); ++i) {
    if (!s.has(kHandActions[i])) continue;
    std::istringstream texts(s.text(kHandActions[i]));
    for (std::string text; texts >> text;)
      out->frames.push_back({static_cast<HandAction>(i), from_hex(text, s, kHandActions[i])});
    const std::string why = confusion(out->frames);
    if (!why.empty()) s.fail(kHandActions[i], why);
  }
  s.finish();
}

bool binds(const RemoteFile& file, HandAction action) {
  const auto is = [&](const auto& binding) { return binding.action == action; };
  return std::any_of(file.frames.begin(), file.frames.end(), is) ||
         std::any_of(file.events.begin(), file.events.end(), is);
}

RemoteFile read_remote(const Document& document) {
  Section root(document, document.root(), "");
  RemoteFile out;
  Section about = root.table("remote");
  out.kind =
      about.choice("kind", {"events", "frames"}) == 0 ? RemoteFile::Kind::kEvents : RemoteFile::Kind::kFrames;
  out.device = about.text("device");
  out.speed_m_s = about.number("speed_m_s", 0.0, 2.0);  // the command line's ranges
  out.turn_hz = about.number("turn_hz", 0.0, 5.0);
  const bool frames = out.kind == RemoteFile::Kind::kFrames;
  out.hold_s = about.number("hold_s", 0.05, 10.0);
  if (frames) out.baud = about.integer("baud", 1200, 115200);
  about.finish();
  if (frames) {
    read_frames(root.table("frames"), &out);
  } else {
    read_events(root.table("events"), &out);
  }
  if (!binds(out, HandAction::kArm) || !binds(out, HandAction::kDisarm))
    root.fail(frames ? "frames" : "events", "needs arm and disarm: who starts motors can stop them");
  root.finish();
  return out;
}

}  // namespace

RemoteFile load_remote(const std::string& path) { return read_remote(Document(path, {})); }

RemoteFile parse_remote(const std::string& text, const std::string& origin) {
  return read_remote(Document::parse(text, origin));
}

std::string to_hex(const std::string& bytes) {
  std::string text(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), reinterpret_cast<const unsigned char*>(bytes.data()),
                 bytes.size());
  text.pop_back();
  return text;
}

/// A frame that another one begins with would always be heard in its place.
std::string confusion(const std::vector<FrameBinding>& frames) {
  for (const FrameBinding& a : frames) {
    for (const FrameBinding& b : frames) {
      if (a.action == b.action || b.bytes.compare(0, a.bytes.size(), a.bytes) != 0) continue;
      const std::string name = kHandActions[index_of(b.action)];
      const std::string other = kHandActions[index_of(a.action)];
      std::string text;
      if (a.bytes == b.bytes)
        return text.append(to_hex(b.bytes)).append(" is ").append(name).append(" and ").append(other);
      text.append(name).append(" (").append(to_hex(b.bytes)).append(") begins with ").append(other);
      return text.append(" (").append(to_hex(a.bytes)).append(")");
    }
  }
  return "";
}

}  // namespace equipoise::app
