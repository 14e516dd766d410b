// What a hand does to a remote of its own, before it means anything to a robot. In: a device's events or
// bytes -> out: shares of the greatest speed, presses. A device judges nothing: HandRemote does. Not RT-safe.
#pragma once

#include <array>
#include <cstddef>

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

class HandDevice {
 public:
  HandDevice() = default;
  virtual ~HandDevice() = default;
  HandDevice(const HandDevice&) = delete;
  HandDevice& operator=(const HandDevice&) = delete;

  /// Waits at most this long, ms; returns at once on a press.
  virtual Hand look(int milliseconds) = 0;
};

}  // namespace equipoise::app
