// Play between a motor and its wheel: while the motor crosses it, it turns alone and the wheel feels nothing.
// In: motor torque over a step -> out: whether the teeth touch; how far the motor is ahead. Simulation only;
// deterministic, no allocation.
#pragma once

#include <cmath>

#include "equipoise/real.hpp"

namespace equipoise {

template <class Real>
struct GearPlayParamsOf {
  Real play_rad{0.0};              // full, at the wheel; 0: none
  Real rotor_inertia_kg_m2{2e-5};  // at the wheel: what crosses the play
};
using GearPlayParams = GearPlayParamsOf<double>;

template <class Real>
class GearPlayOf {
 public:
  /// One step; true when the teeth are in contact. `torque_N_m`: of the motor at its own rate.
  auto step(const GearPlayParamsOf<Real>& p, const Real& torque_N_m, double step_s) noexcept {
    using std::abs;
    const Real half = 0.5 * p.play_rad;
    const auto touch = ahead_rad_ == select(torque_N_m >= 0.0, half, -half);
    const Real rate = rate_rad_s_ + step_s * torque_N_m / p.rotor_inertia_kg_m2;
    const Real ahead = ahead_rad_ + step_s * rate;
    const auto across = abs(ahead) >= half;  // contact without rebound
    ahead_rad_ = select(touch, ahead_rad_, select(across, select(ahead < 0.0, -half, half), ahead));
    rate_rad_s_ = select(touch || across, Real(0.0), rate);
    return touch;
  }

  /// Motor ahead of its wheel, within +- half the play, and how fast while it crosses.
  const Real& ahead_rad() const noexcept { return ahead_rad_; }
  const Real& rate_rad_s() const noexcept { return rate_rad_s_; }

 private:
  Real ahead_rad_{0.0};
  Real rate_rad_s_{0.0};
};
using GearPlay = GearPlayOf<double>;

}  // namespace equipoise
