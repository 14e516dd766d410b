// One step of the midpoint rule, and its Jacobian. In: derivative with Jacobian, state, step -> out: next
// state, F = d(next)/d(state). Explicit Euler lengthens what turns with the frame by (Omega dt)^2 / 2 per
// tick, which a filter explains by a lean. RT-safe.
#pragma once

#include "equipoise/types.hpp"

namespace equipoise {

/// `derivative(x, x_dot, A)`: dx/dt and d(x_dot)/dx.
template <int n, class Derivative>
void midpoint(const Derivative& derivative, const Vec<n>& x, double dt, Vec<n>& x_next,
              Mat<n, n>& F) noexcept {
  Vec<n> x_dot;
  Mat<n, n> A;
  derivative(x, x_dot, A);
  const Mat<n, n> half = Mat<n, n>::Identity() + 0.5 * dt * A;
  derivative(x + 0.5 * dt * x_dot, x_dot, A);
  x_next = x + dt * x_dot;
  F.noalias() = dt * A * half;
  F += Mat<n, n>::Identity();
}

}  // namespace equipoise
