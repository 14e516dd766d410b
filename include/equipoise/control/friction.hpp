// Coulomb friction compensation about the body axes.
// In: ball rate relative to the body -> out: addition to u. Source: [T] (6.14)-(6.15).
// Stateless, RT-safe.
#pragma once

#include "equipoise/types.hpp"

namespace equipoise {

struct FrictionCompensation {
  double coulomb_u = 0.0;  // mu_c / k1
  double gain = 1.0;       // share that is compensated; above 1 it limit-cycles

  /// Smoothed sign, 95 % at |x| = 1.5 rad/s. (6.15)
  static double smooth_sign(double x) noexcept { return std::copysign(-std::expm1(-2.0 * std::abs(x)), x); }

  template <int N>
  Vec<N> compensate(const Vec<N>& relative_rate_rad_s) const noexcept {
    Vec<N> u;
    for (int i = 0; i < N; ++i) u(i) = gain * coulomb_u * smooth_sign(relative_rate_rad_s(i));
    return u;
  }
};

}  // namespace equipoise
