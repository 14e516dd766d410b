// Encoders that count nothing: dead, or of wheels that friction holds? Nobody can tell while the robot stands
// still, so it is turned on the spot a little. When no encoder has counted for a quarter of a second a drive
// grows, up to several times what starts a wheel; the first count ends it. None by its end: dead.
// In: armed, Measurement, what turns the robot already -> out: a drive to add to that; dead().
// RT-safe.
#pragma once

#include <algorithm>

#include "equipoise/samples.hpp"

namespace equipoise {

template <int Wheels>
class EncoderProbe {
 public:
  // Ticks without a count, of a growing drive, and at its largest; to the verdict 0.45 s.
  static constexpr int kPatience = 50;
  static constexpr int kGrows = 30;
  static constexpr int kHolds = 10;
  static constexpr int kTicks = kPatience + kGrows + kHolds;

  /// `drive`: of full duty, at its largest; 0: no probe.
  explicit EncoderProbe(double drive) : drive_(drive) {}

  /// No encoder has counted, whatever the motors did; until the motors are off.
  bool dead() const noexcept { return dead_; }

  /// `turning`: the drive about the vertical so far. It is pushed where it pushes, so that a robot which
  /// friction holds off its heading gets nearer to it.
  double update(bool armed, const Measurement<Wheels>& z, double turning) noexcept {
    if (!(drive_ > 0.0)) return 0.0;
    const bool counted = !(known_ && z.encoders_ok && z.wheel_angle_rad == angle_rad_);
    known_ = armed && z.encoders_ok;
    angle_rad_ = z.wheel_angle_rad;
    dead_ = dead_ && armed;
    silent_ = armed && !counted ? std::min(silent_ + z.ticks, kTicks) : 0;
    if (silent_ <= kPatience) {
      sense_ = turning < 0.0 ? -1.0 : 1.0;
      return 0.0;
    }
    dead_ = dead_ || silent_ >= kTicks;
    return sense_ * drive_ * std::min(1.0, static_cast<double>(silent_ - kPatience) / kGrows);
  }

 private:
  double drive_;
  Vec<Wheels> angle_rad_ = Vec<Wheels>::Zero();
  bool known_ = false;
  int silent_ = 0;  // ticks
  double sense_ = 1.0;
  bool dead_ = false;
};

}  // namespace equipoise
