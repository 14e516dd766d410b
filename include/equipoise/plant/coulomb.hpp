// Coulomb friction of all axes over one step: sticking and sliding in one rule.
// In: relative rates that the step would end with if nothing rubbed, their response to torque -> out: per
// axis the constant torque that ends the step at rest, at most mu_c. Simulation only; deterministic, no
// allocation.
#pragma once

#include <algorithm>

#include "equipoise/types.hpp"

namespace equipoise {

/// Axes that do not influence each other; `mobility`: 1/effective inertia of each.
template <int N>
Vec<N> coulomb_torque(const Vec<N>& free_rate, const Vec<N>& mobility, double step_s, double mu_c) noexcept {
  Vec<N> tau;
  for (int i = 0; i < N; ++i) {
    tau(i) = std::clamp(-free_rate(i) / (step_s * mobility(i)), -mu_c, mu_c);
  }
  return tau;
}

/// Coupled axes, each with its own limit: the same rule by projected Gauss-Seidel sweeps.
template <int N>
Vec<N> coulomb_torque(const Vec<N>& free_rate, const Mat<N, N>& mobility, double step_s,
                      const Vec<N>& mu_c) noexcept {
  constexpr int kSweeps = 20;
  Vec<N> tau = Vec<N>::Zero();
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (int i = 0; i < N; ++i) {
      const double rate = free_rate(i) + step_s * mobility.row(i).dot(tau);
      tau(i) = std::clamp(tau(i) - rate / (step_s * mobility(i, i)), -mu_c(i), mu_c(i));
    }
  }
  return tau;
}

}  // namespace equipoise
