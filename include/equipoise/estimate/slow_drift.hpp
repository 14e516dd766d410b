// How far a gyro's bias has gone lately that may only creep with the temperature. In: bias -> out: its
// distance from its own mean over the last 20 s. RT-safe.
#pragma once

#include <algorithm>

#include "equipoise/types.hpp"

namespace equipoise {

/// `Axes`: of the gyro.
template <int Axes>
class SlowDrift {
 public:
  void reset(const Vec<Axes>& bias_rad_s) noexcept {
    bias_rad_s_ = mean_rad_s_ = bias_rad_s;
    jumped_rad_s_ = 0.0;
  }
  void update(const Vec<Axes>& bias_rad_s) noexcept {
    constexpr double kShare = kTickS / 20.0;
    bias_rad_s_ = bias_rad_s;
    mean_rad_s_ += kShare * (bias_rad_s - mean_rad_s_);
    jumped_rad_s_ -= kShare * jumped_rad_s_;  // no sooner than the mean comes back
  }
  /// It was found anew, as well as one noisy sample tells.
  void jumped() noexcept { jumped_rad_s_ = 0.15; }
  double distance_rad_s() const noexcept {
    return std::max(0.0, (bias_rad_s_ - mean_rad_s_).norm() - jumped_rad_s_);
  }

 private:
  Vec<Axes> bias_rad_s_ = Vec<Axes>::Zero();
  Vec<Axes> mean_rad_s_ = Vec<Axes>::Zero();
  double jumped_rad_s_ = 0.0;
};

}  // namespace equipoise
