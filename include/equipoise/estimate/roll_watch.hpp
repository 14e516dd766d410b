// Does the gyro say that a robot on two wheels rolls on and on about the axis that points ahead? It cannot:
// what hits a wheel rocks it to and fro, and on a slope it rolls with its yaw rate. A gyro whose bias grows
// says so; all else that it does a push might do. In: rate about that axis beyond the
// model's, yaw rate -> out: whether the gyro can be trusted. RT-safe.
#pragma once

#include <algorithm>
#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {

class RollWatch {
 public:
  void reset() noexcept { mean_ = 0.0; }

  void hear(double rolls_rad_s, double yaw_rate_rad_s) noexcept {
    const double beyond = std::abs(rolls_rad_s) - kSlope * std::abs(yaw_rate_rad_s);
    const double sign = std::copysign(std::clamp(beyond / kRolls_rad_s, 0.0, 1.0), rolls_rad_s);
    mean_ += kTickS / kMean_s * (sign - mean_);
  }
  bool trusted() const noexcept { return std::abs(mean_) <= kOneWay; }

 private:
  static constexpr double kSlope = 0.07;       // twice 2 degrees: from floor to floor
  static constexpr double kRolls_rad_s = 0.1;  // a wheel that climbs 0.7 mm in 0.1 s
  static constexpr double kMean_s = 0.5;       // a robot that tips over sideways takes as long
  static constexpr double kOneWay = 0.8;

  double mean_ = 0.0;  // of the sign
};

}  // namespace equipoise
