// Tilt of a robot that is held still, from the averaged accelerometer, without its garbage: the estimators
// start from it.
// In: gravity minus acceleration, body axes -> out: roll, pitch. RT-safe.
#pragma once

#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {

class RestTilt {
 public:
  Vec2 update(const Vec3& accel_B_m_s2) noexcept {
    if (!(std::abs(accel_B_m_s2.norm() - kGravity_m_s2) < kShaken_m_s2)) return tilt();  // NaN, too
    // A running mean first, then an exponential one: the first estimate is already unbiased.
    samples_ = samples_ < kWindow ? samples_ + 1 : kWindow;
    mean_ += (accel_B_m_s2 - mean_) / samples_;
    return tilt();
  }

  /// y = R^T (0, 0, -g): roll and pitch of R = Rz Ry Rx.
  Vec2 tilt() const noexcept {
    if (samples_ == 0) return Vec2::Zero();
    return {std::atan2(-mean_.y(), -mean_.z()), std::atan2(mean_.x(), std::hypot(mean_.y(), mean_.z()))};
  }

 private:
  static constexpr int kWindow = 100;                          // ticks, 0.5 s
  static constexpr double kShaken_m_s2 = 0.5 * kGravity_m_s2;  // no sample of a robot that a hand holds
  Vec3 mean_ = Vec3::Zero();
  int samples_ = 0;
};

}  // namespace equipoise
