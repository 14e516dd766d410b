// Play between a motor and its wheel: while the motor crosses it, it turns alone and the wheel feels nothing.
// In: motor torque over a step -> out: whether the teeth touch; how far the motor is ahead. Simulation only;
// deterministic, no allocation.
#pragma once

#include <cmath>

namespace equipoise {

struct GearPlayParams {
  double play_rad = 0.0;              // full, at the wheel; 0: none
  double rotor_inertia_kg_m2 = 2e-5;  // at the wheel: what crosses the play
};

class GearPlay {
 public:
  /// One step; true when the teeth are in contact. `torque_N_m`: of the motor at its own rate.
  bool step(const GearPlayParams& p, double torque_N_m, double step_s) noexcept {
    const double half = 0.5 * p.play_rad;
    if (ahead_rad_ == (torque_N_m >= 0.0 ? half : -half)) {
      rate_rad_s_ = 0.0;
      return true;
    }
    rate_rad_s_ += step_s * torque_N_m / p.rotor_inertia_kg_m2;
    ahead_rad_ += step_s * rate_rad_s_;
    if (std::abs(ahead_rad_) >= half) {  // across: contact without rebound
      ahead_rad_ = std::copysign(half, ahead_rad_);
      rate_rad_s_ = 0.0;
    }
    return false;
  }

  /// Motor ahead of its wheel, within +- half the play, and how fast while it crosses.
  double ahead_rad() const noexcept { return ahead_rad_; }
  double rate_rad_s() const noexcept { return rate_rad_s_; }

 private:
  double ahead_rad_ = 0.0;
  double rate_rad_s_ = 0.0;
};

}  // namespace equipoise
