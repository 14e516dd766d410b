// Coulomb friction of all axes over one step: sticking and sliding in one rule.
// In: relative rates that the step would end with if nothing rubbed, their response to torque -> out: per
// axis the constant torque that ends the step at rest, at most mu_c. Simulation only; deterministic, no
// allocation.
#pragma once

#include <algorithm>
#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {

/// Stribeck: breaking away takes more than keeping moving.
struct Stiction {
  double static_ratio = 1.0;  // breakaway over Coulomb friction; 1: the same
  double rate_rad_s = 0.5;    // where the difference has fallen to 1/e

  /// Friction at `rate` over Coulomb friction.
  double factor(double rate) const noexcept {
    if (static_ratio == 1.0) return 1.0;
    const double slow = rate / rate_rad_s;
    return 1.0 + (static_ratio - 1.0) * std::exp(-slow * slow);
  }
};

/// One axis; `mobility`: 1/effective inertia.
inline double coulomb_torque(double free_rate, double mobility, double step_s, double mu_c) noexcept {
  return std::clamp(-free_rate / (step_s * mobility), -mu_c, mu_c);
}
/// Axes that do not influence each other, each with its own limit.
inline Vec3 uncoupled_coulomb_torque(const Vec3& free_rate, const Vec3& mobility, double step_s,
                                     const Vec3& mu_c) noexcept {
  Vec3 tau;
  for (int i = 0; i < 3; ++i) tau(i) = coulomb_torque(free_rate(i), mobility(i), step_s, mu_c(i));
  return tau;
}

/// Coupled axes, each with its own limit: the same rule by projected Gauss-Seidel sweeps.
template <int N>
Vec<N> coulomb_torque(const Vec<N>& free_rate, const Mat<N, N>& mobility, double step_s,
                      const Vec<N>& mu_c) noexcept {
  constexpr int kSweeps = 20;
  Vec<N> tau = Vec<N>::Zero();
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    const Vec<N> before = tau;
    for (int i = 0; i < N; ++i) {
      const double rate = free_rate(i) + step_s * mobility.row(i).dot(tau);
      tau(i) = std::clamp(tau(i) - rate / (step_s * mobility(i, i)), -mu_c(i), mu_c(i));
    }
    if (tau == before) break;  // every further sweep would say the same
  }
  return tau;
}

}  // namespace equipoise
