// One step of every simulated robot: classical Runge-Kutta of fourth order.
// In: state, its derivative there (which friction has needed already), step, derivative -> out: next state.
// Simulation only; deterministic, no allocation.
#pragma once

namespace equipoise {

template <class State, class Derivative>
State rk4_step(const State& s, const State& k1, double step_s, Derivative&& derivative) noexcept {
  const State k2 = derivative(State(s + 0.5 * step_s * k1));
  const State k3 = derivative(State(s + 0.5 * step_s * k2));
  const State k4 = derivative(State(s + step_s * k3));
  return s + step_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
}

}  // namespace equipoise
