// Omniwheel placement on the ball: latitude alpha from the north pole, tilt beta about the contact normal.
// In: alpha, azimuth -> beta for mutually orthogonal wheels and T_ob, whose columns are the wheel axes in
// body axes. Source: [T] (2.3)-(2.5); beta in closed form, cos(beta) = 1/(sqrt(3) sin(alpha)). Not for the
// tick (trigonometry at start-up only); no allocation.
#pragma once

#include <Eigen/Dense>

#include "equipoise/types.hpp"

namespace equipoise {

/// Tilt that makes the three wheel axes mutually orthogonal; needs sin(alpha) >= 1/sqrt(3), else NaN.
inline double orthogonal_beta_rad(double alpha_rad) noexcept {
  return std::acos(1.0 / (std::sqrt(3.0) * std::sin(alpha_rad)));
}

/// T_ob = [w1 w2 w3], orthonormal if beta = orthogonal_beta_rad(alpha). `azimuth_rad` turns all wheels about
/// z; alpha = 60 deg, azimuth = -140 deg give [T] (6.5).
inline Mat3 wheel_axes(double alpha_rad, double beta_rad, double azimuth_rad) noexcept {
  // Axis in the tangent plane at the contact: along the rising meridian, tilted by beta towards the parallel.
  const Vec3 meridian(std::cos(alpha_rad), 0.0, std::sin(alpha_rad));
  const Vec3 first = std::cos(beta_rad) * meridian - std::sin(beta_rad) * Vec3::UnitY();
  Mat3 T_ob;
  for (int i = 0; i < 3; ++i) {
    T_ob.col(i) = Eigen::AngleAxisd(azimuth_rad + 2.0 * kPi / 3.0 * i, Vec3::UnitZ()) * first;
  }
  return T_ob;
}

/// Load on one wheel per unit weight, [T] (2.2).
inline double normal_force_over_weight(double alpha_rad) noexcept {
  return 1.0 / (3.0 * std::cos(alpha_rad));
}

}  // namespace equipoise
