// `equipoise remote`: learns the buttons of an app, and turns a remote in the hand into lines for send
// --live.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/commission/manual_drive.hpp"
#include "app/remote/frame_learning.hpp"
#include "app/remote/hand_remote.hpp"
#include "app/text/files.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/monotonic.hpp"
#include "serial.h"

namespace equipoise::app {
namespace {

struct LearnArguments {
  std::string port;
  std::string out;
  int baud = 9600;
  double wait_s = 60.0;
};

struct Port : NoCopy {
  explicit Port(const LearnArguments& a) {
    const int status = serial_open(&serial, a.port.c_str(), static_cast<std::uint32_t>(a.baud));
    if (status == -EINVAL) throw InputError("serial: " + std::to_string(a.baud) + " baud: 1200 to 115200");
    if (status < 0)
      throw std::runtime_error("serial: " + a.port + ": " + std::strerror(-status) +
                               "; pair the device and name its port, as after rfcomm bind 0 ADDRESS");
  }
  ~Port() { serial_close(&serial); }

  /// Until it was quiet for a second after something came, or nothing came for so long, or Enter; JobError
  /// when it does not end.
  std::vector<Portion> listen(double wait_s) {
    constexpr double kQuiet_s = 1.0;
    constexpr double kLongest_s = 20.0;
    std::vector<Portion> portions;
    for (double until_s = runtime::now_s() + wait_s; runtime::now_s() < until_s && !interrupted.load();) {
      constexpr int kPatience_ms = 50;
      std::array<pollfd, 2> ready{{{serial.fd, POLLIN, 0}, {keys, POLLIN, 0}}};
      if (poll(ready.data(), ready.size(), kPatience_ms) <= 0) continue;
      if (ready[1].revents != 0 && portions.empty() && entered()) return portions;
      std::array<std::uint8_t, 256> bytes{};
      const int count = serial_read(&serial, bytes.data(), bytes.size());
      if (count == -EAGAIN) continue;
      if (count < 0) throw JobError("the serial port is gone");
      const auto* first = reinterpret_cast<const char*>(bytes.data());
      portions.push_back({runtime::now_s(), std::string(first, first + count)});
      if (portions.back().t_s - portions.front().t_s > kLongest_s)
        throw JobError("bytes come for 20 s without a pause of a second: no button of an app");
      until_s = runtime::now_s() + kQuiet_s;
    }
    if (interrupted.load()) throw JobError("interrupted; nothing was written");
    return portions;
  }

  /// Not at the end of what is typed: nobody types there.
  bool entered() {
    std::array<char, 256> typed{};
    const ssize_t count = ::read(keys, typed.data(), typed.size());
    if (count <= 0) keys = -1;
    return count > 0;
  }

  serial_t serial{-1};
  int keys = STDIN_FILENO;
};

/// Adds what one button sends; false: it is to be held again.
bool learn_action(Port& port, HandAction action, double wait_s, std::vector<FrameBinding>* frames) {
  const LearntButton learnt = learn_button(port.listen(wait_s));
  if (learnt.frame.empty()) {
    std::fprintf(stderr, "  nothing came: skipped\n");
    return true;
  }
  std::vector<FrameBinding> with = *frames;
  with.push_back({action, learnt.frame});
  // What letting go sends is the same for every button of some apps.
  const bool new_stop =
      !learnt.released.empty() && std::none_of(with.begin(), with.end(), [&](const FrameBinding& b) {
        return b.action == HandAction::kStop && b.bytes == learnt.released;
      });
  if (new_stop) with.push_back({HandAction::kStop, learnt.released});
  const std::string why = learnt.error.empty() ? confusion(with) : learnt.error;
  if (!why.empty()) {
    std::fprintf(stderr, "  %s\n", why.c_str());
    return false;
  }
  std::fprintf(stderr, "  %s%s%s\n", to_hex(learnt.frame).c_str(),
               learnt.released.empty() ? "" : ", released: ", to_hex(learnt.released).c_str());
  *frames = std::move(with);
  return true;
}

std::string file_of(const LearnArguments& a, const std::vector<FrameBinding>& frames) {
  std::string text =
      "# Buttons of an app through an HC-06, learnt by equipoise remote learn. For run --remote.\n\n"
      "[remote]\nkind = \"frames\"\ndevice = \"" +
      a.port +
      "\"  # path, or the port's address\n"
      "baud = " +
      std::to_string(a.baud) +
      "\n"
      "speed_m_s = 0.1   # of a button that is held\n"
      "turn_hz = 0.25\n"
      "hold_s = 0.5      # how long a frame lasts: longer than the app's pause between two\n\n"
      "[frames]          # bytes in hexadecimal\n";
  for (std::size_t i = 0; i < kHandActions.size(); ++i) {
    std::string list;
    for (const FrameBinding& frame : frames)
      if (index_of(frame.action) == i) list += (list.empty() ? "" : " ") + to_hex(frame.bytes);
    if (!list.empty()) text += std::string(kHandActions[i]) + " = \"" + list + "\"\n";
  }
  return text;
}

int learn(const LearnArguments& a) {
  check_output(a.out, {"# Buttons of an app"}, "buttons of an app");
  watch_interrupts();
  Port port(a);
  std::vector<FrameBinding> frames;
  for (std::size_t i = 0; i < kHandActions.size(); ++i) {
    constexpr int kTries = 3;
    for (int tried = 1;; ++tried) {
      std::fprintf(stderr, "Hold the button for %s for two seconds, then release it (none: Enter)\n",
                   kHandActions[i]);
      if (learn_action(port, static_cast<HandAction>(i), a.wait_s, &frames)) break;
      if (tried == kTries) throw JobError(std::string(kHandActions[i]) + ": not learnt; nothing was written");
    }
  }
  const std::string text = file_of(a, frames);
  (void)parse_remote(text, a.out);  // arm and disarm are there
  std::ofstream file(a.out);
  if (!(file << text) || !file.flush()) throw std::runtime_error(a.out + ": cannot be written");
  std::fprintf(stderr, "%s: written; try it with equipoise remote lines %s\n", a.out.c_str(), a.out.c_str());
  return 0;
}

int lines(const std::string& path) {
  watch_interrupts();
  const RemoteFile file = load_remote(path);
  const auto device = open_hand(file);
  HandGate gate;
  bool moved = false;
  bool present = true;
  double next_s = 0.0;
  double looked_s = runtime::now_s();
  double void_until_s = 0.0;
  while (!interrupted.load()) {
    constexpr int kLook_ms = 20;
    constexpr double kEvery_s = 0.05;
    constexpr double kStopped_s = 1.0;  // this process, or whoever reads its lines
    constexpr double kQueued_s = 0.2;   // what was kept meanwhile comes at once
    Hand hand = gate.limit(device->look(kLook_ms));
    if (runtime::now_s() > looked_s + kStopped_s) void_until_s = runtime::now_s() + kQueued_s;
    looked_s = runtime::now_s();
    if (looked_s < void_until_s) hand.arm = hand.heading_reset = false;  // pressed who knows when
    if (hand.present != present)
      std::fprintf(stderr, "%s: %s\n", path.c_str(), hand.present ? "is back" : "is gone");
    present = hand.present;
    bool said = hand.disarm || hand.arm || hand.heading_reset;
    if (hand.disarm) {
      std::printf("disarm\n");
    } else if (hand.arm) {
      std::printf("arm\n");
    }
    if (hand.heading_reset) std::printf("heading-reset\n");
    const bool moves = hand.forward != 0.0 || hand.left != 0.0 || hand.turn != 0.0;
    if ((moves && runtime::now_s() >= next_s) || (moved && !moves)) {
      std::printf("drive %.4g %.4g %.4g\n", file.speed_m_s * hand.forward, file.speed_m_s * hand.left,
                  file.turn_hz * hand.turn);
      next_s = runtime::now_s() + kEvery_s;
      moved = moves;
      said = true;
    }
    if (said && std::fflush(stdout) != 0) return 0;  // whoever read them has gone
  }
  return 0;
}

}  // namespace

void add_remote(Subcommand app) {
  const Subcommand remote =
      app.subcommand("remote", "Hand-held remotes: gamepad, keyboard, or an app through an HC-06")
          .example("equipoise remote learn --port /dev/rfcomm0 --out remote.toml");
  remote.require_subcommand();

  const Subcommand teach =
      remote.subcommand("learn", "Asks for one button of an app after the other and writes what they send")
          .example("equipoise remote learn --port 48022000 --out remote.toml");
  auto a = std::make_shared<LearnArguments>();
  teach.option("--port", a->port, "serial port of the HC-06: path, or on a board its address").required();
  teach.option("--baud", a->baud, "bit rate, baud").show_default().range(1200, 115200);
  teach.option("--wait-s", a->wait_s, "longest wait for a button, s").show_default().range(0.1, 600.0);
  teach.option("--out", a->out, "file to write").file().required();
  teach.action([=] { return learn(*a); });

  auto path = std::make_shared<std::string>();
  const Subcommand say =
      remote
          .subcommand("lines",
                      "Prints what a remote asks for as lines for send --live: for a remote that is not "
                      "plugged into the robot")
          .example("equipoise remote lines config/remotes/gamepad.toml");
  say.option("file", *path, "the remote, TOML; see config/remotes").file().required();
  say.action([=] { return lines(*path); });
}

}  // namespace equipoise::app
