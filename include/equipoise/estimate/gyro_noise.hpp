// How much a gyro shakes from sample to sample. In: its samples -> out: mean second difference of the worst
// axis, and whether a robot could balance on it. rad/s, body axes. RT-safe.
#pragma once

#include <algorithm>
#include <array>

#include "equipoise/types.hpp"

namespace equipoise {

class GyroNoise {
 public:
  void hear(const Vec3& gyro_rad_s) noexcept {
    const Vec3 second = gyro_rad_s - 2.0 * heard_[0] + heard_[1];
    heard_[1] = heard_[0];
    heard_[0] = gyro_rad_s;
    samples_ = std::min(samples_ + 1, 3);
    if (samples_ == 3)
      mean_rad_s_ += kMean * (std::min(second.cwiseAbs().maxCoeff(), kMost_rad_s) - mean_rad_s_);
  }

  double rad_s() const noexcept { return mean_rad_s_; }
  /// No robot shakes like that.
  bool too_much() const noexcept { return mean_rad_s_ > kTooMuch_rad_s; }

 private:
  static constexpr double kMean = 0.05;          // about 20 ticks
  static constexpr double kMost_rad_s = 1.0;     // one bad sample of ten stays below 0.42
  static constexpr double kTooMuch_rad_s = 0.6;  // sound robots stay below 0.18

  std::array<Vec3, 2> heard_{Vec3::Zero(), Vec3::Zero()};  // latest first
  int samples_ = 0;
  double mean_rad_s_ = 0.0;
};

}  // namespace equipoise
