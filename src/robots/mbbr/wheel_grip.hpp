// What three wheels pass on to the ball when each carries at most grip x load, while the loads depend on what
// all of them pass on. In: torques that would hold every contact, loads over passed torque -> out: torques
// passed on. Held where holding is consistent, else a damped fixed point of bounded length. Coulomb's law;
// equations: docs/disturbances.md. Simulation only; deterministic, no allocation.
#pragma once

#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

/// Normal loads, linear in the torques that the wheels pass on.
struct WheelLoads {
  Vec3 coasting_N = Vec3::Zero();      // where nothing is passed on
  Mat3 per_torque_1_m = Mat3::Zero();  // N per N m
  Vec3 under(const Vec3& passed_N_m) const noexcept { return coasting_N + per_torque_1_m * passed_N_m; }
};

/// `grip_m`: friction coefficient times wheel radius.
Vec3 passed_on(const Vec3& sticking_N_m, const WheelLoads& loads, double grip_m) noexcept;

/// What a wheel carries at rest, (2.2).
double grip_limit_N_m(double wheel_grip, const MbbrParameters& robot) noexcept;

}  // namespace equipoise
