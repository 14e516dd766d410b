// Gyro bias of a robot that is held still. In: body rates -> out: their mean over the last stretch of rest,
// zero until there is one. Turning by hand is no bias: it begins the stretch anew. RT-safe.
#pragma once

#include "equipoise/types.hpp"

namespace equipoise {

class RestBias {
 public:
  Vec3 update(const Vec3& gyro_B_rad_s) noexcept {
    if (!(gyro_B_rad_s.norm() < kRest_rad_s)) {
      samples_ = 0;
      mean_.setZero();
      return bias_;
    }
    samples_ = samples_ < kWindow ? samples_ + 1 : kWindow;
    mean_ += (gyro_B_rad_s - mean_) / samples_;
    if (samples_ >= kEnough) bias_ = mean_;
    return bias_;
  }

 private:
  static constexpr double kRest_rad_s = 0.05;  // a calibrated gyro's bias and noise stay far below
  static constexpr int kEnough = 50;           // ticks, 0.25 s
  static constexpr int kWindow = 400;
  Vec3 mean_ = Vec3::Zero();
  Vec3 bias_ = Vec3::Zero();
  int samples_ = 0;
};

}  // namespace equipoise
