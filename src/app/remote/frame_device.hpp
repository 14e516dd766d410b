// An app's buttons through an HC-06, as a hand's device: every button sends bytes of its own, while it is
// held or once. In: bytes -> out: Hand. A button lasts hold_s after its newest frame, so silence is a hand
// that has let go. Arming takes two frames within a second: bytes have no checksum, and noise must not arm.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "app/remote/remote_file.hpp"
#include "serial.h"

namespace equipoise::app {

/// Frames in a stream of bytes; what is none is skipped. Bounded memory.
class FrameMatcher {
 public:
  explicit FrameMatcher(const std::vector<FrameBinding>& frames) : frames_(frames) {}

  std::optional<HandAction> push(char byte);
  /// The line was quiet: a frame does not go on.
  void forget() { begun_.clear(); }

 private:
  const std::vector<FrameBinding>& frames_;
  std::string begun_;
};

/// What the buttons come to.
class ButtonPad {
 public:
  explicit ButtonPad(double hold_s) : hold_s_(hold_s) {}

  void press(HandAction action, double now_s);
  /// Presses are told once.
  Hand hand(double now_s);

  static constexpr double kArmTwiceWithin_s = 1.0;

 private:
  static constexpr double kNever_s = -1e9;

  double hold_s_;
  std::array<double, kHandActions.size()> until_s_ = [] {
    std::array<double, kHandActions.size()> never{};
    never.fill(kNever_s);
    return never;
  }();
  double heard_until_s_ = kNever_s;
  double armed_at_s_ = kNever_s;
  bool arm_told_ = false;
  Hand pressed_{};
};

class FrameDevice final : public HandDevice {
 public:
  /// runtime_error when the port cannot be opened.
  explicit FrameDevice(RemoteFile file);
  ~FrameDevice() override;

  Hand look(int milliseconds) override;

 private:
  RemoteFile file_;
  FrameMatcher matcher_;
  ButtonPad pad_;
  serial_t serial_{-1};
  double byte_s_ = 0.0;
};

}  // namespace equipoise::app
