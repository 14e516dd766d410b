// One step of Heun's third-order rule, and its Jacobian. In: derivative with Jacobian, state, step -> out:
// next state, F = d(next)/d(state). A lower order is not enough in a turning frame: explicit Euler lengthens
// what turns with it by (Omega dt)^2 / 2 per tick, the midpoint rule errs by dt^3 / 6 A^2 f, which the
// motors' back-EMF (A dt = -0.22) and a ball rate that turns (f = Omega phi*') make 1 rad/s^2 at 3 Hz and 20
// cm/s; a filter explains either by a lean. RT-safe.
#pragma once

#include "equipoise/types.hpp"

namespace equipoise {

/// `derivative(x, x_dot, A)`: dx/dt and d(x_dot)/dx.
template <int n, class Derivative>
void heun(const Derivative& derivative, const Vec<n>& x, double dt, Vec<n>& x_next, Mat<n, n>& F) noexcept {
  Vec<n> first;
  Vec<n> x_dot;
  Mat<n, n> A_first;
  Mat<n, n> A;
  derivative(x, first, A_first);
  derivative(x + dt / 3.0 * first, x_dot, A);
  const Mat<n, n> third = Mat<n, n>::Identity() + dt / 3.0 * A_first;
  Mat<n, n> slope;
  slope.noalias() = 2.0 * dt / 3.0 * A * third;
  slope += Mat<n, n>::Identity();
  derivative(x + 2.0 * dt / 3.0 * x_dot, x_dot, A);
  x_next = x + dt / 4.0 * (first + 3.0 * x_dot);
  F.noalias() = 0.75 * dt * A * slope;
  F += Mat<n, n>::Identity() + 0.25 * dt * A_first;
}

/// Without the Jacobian; `derivative(x)`: dx/dt.
template <int n, class Derivative>
Vec<n> heun(const Derivative& derivative, const Vec<n>& x, double dt) noexcept {
  const Vec<n> first = derivative(x);
  const Vec<n> second = derivative(x + dt / 3.0 * first);
  const Vec<n> third = derivative(x + 2.0 * dt / 3.0 * second);
  return x + dt / 4.0 * (first + 3.0 * third);
}

}  // namespace equipoise
