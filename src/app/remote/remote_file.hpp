// A remote in a hand as a file (config/remotes/*.toml): which device, what its controls do, how fast full is.
// In: path -> out: RemoteFile; ConfigError (file:line: key: reason and what is allowed). Start-up only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "equipoise/no_copy.hpp"

namespace equipoise::app {

enum class HandAction {
  kArm,
  kDisarm,
  kForward,
  kBack,
  kLeft,
  kRight,
  kTurnLeft,
  kTurnRight,
  kHeadingReset,
  kStop,
};

inline constexpr std::array<const char*, 10> kHandActions{
    "arm", "disarm", "forward", "back", "left", "right", "turn_left", "turn_right", "heading_reset", "stop"};

constexpr std::size_t index_of(HandAction action) { return static_cast<std::size_t>(action); }

struct Hand {
  bool present = true;  // the device is there
  bool heard = false;   // somebody has it in the hand; else its motion is void
  double forward = 0.0;
  double left = 0.0;
  double turn = 0.0;  // counterclockwise; each -1 .. 1
  bool arm = false;   // pressed since the last look, like the next two
  bool disarm = false;
  bool heading_reset = false;
};

class HandDevice : NoCopy {
 public:
  virtual ~HandDevice() = default;

  /// Waits at most this long, ms; returns at once on a press.
  virtual Hand look(int milliseconds) = 0;
};

/// A key or button, or an axis that is pushed one way.
struct EventBinding {
  HandAction action{};
  bool axis = false;
  std::uint16_t code = 0;
  double sign = 1.0;
};

struct FrameBinding {
  HandAction action{};
  std::string bytes;
};

struct RemoteFile {
  enum class Kind { kEvents, kFrames };
  Kind kind = Kind::kEvents;
  std::string device;  // path, or a serial port's address
  double speed_m_s = 0.0;
  double turn_hz = 0.0;
  std::vector<EventBinding> events;
  std::optional<std::pair<int, int>> axis_range;  // of a device that does not say it
  double hold_s = 0.5;  // how long a button lasts after its frame; a stick without any event
  int baud = 9600;
  std::vector<FrameBinding> frames;
};

RemoteFile load_remote(const std::string& path);
/// From text; `origin` names it in errors.
RemoteFile parse_remote(const std::string& text, const std::string& origin);

/// Why these frames cannot be told apart; empty: they can.
std::string confusion(const std::vector<FrameBinding>& frames);
std::string to_hex(const std::string& bytes);

}  // namespace equipoise::app
