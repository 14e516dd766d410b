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

/// Axes that do not influence each other, each with its own limit; `mobility`: 1/effective inertia of each.
template <class Real, int N>
VecOf<Real, N> uncoupled_coulomb_torque(const VecOf<Real, N>& free_rate, const VecOf<Real, N>& mobility,
                                        double step_s, const VecOf<Real, N>& mu_c) noexcept {
  VecOf<Real, N> tau;
  for (int i = 0; i < N; ++i) {
    tau(i) = limited<Real>(-free_rate(i) / (step_s * mobility(i)), -mu_c(i), mu_c(i));
  }
  return tau;
}

/// Coupled axes, each with its own limit: the same rule by projected Gauss-Seidel sweeps.
template <class Real, int N>
VecOf<Real, N> coulomb_torque(const VecOf<Real, N>& free_rate, const MatOf<Real, N, N>& mobility,
                              double step_s, const VecOf<Real, N>& mu_c) noexcept {
  constexpr int kSweeps = 20;
  VecOf<Real, N> tau = VecOf<Real, N>::Zero();
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    auto same = tau(0) == tau(0);
    for (int i = 0; i < N; ++i) {
      const Real before = tau(i);
      const Real rate = free_rate(i) + step_s * mobility.row(i).dot(tau);
      tau(i) = limited<Real>(tau(i) - rate / (step_s * mobility(i, i)), -mu_c(i), mu_c(i));
      same = same && tau(i) == before;
    }
    if (all(same)) break;  // every further sweep would say the same
  }
  return tau;
}

}  // namespace equipoise
