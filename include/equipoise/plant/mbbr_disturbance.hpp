// What a real MBBR does and its model leaves out, each effect off by default and zero-cost then.
// In: state of the drive at the start of a step -> out: torques, friction limits, encoder errors of the step.
// Source: [T] (2.1)-(2.2), sections 4.2.2, 5.3, 6.3, 6.5; magnitudes are calibrated (docs/calibration.md).
// Simulation only; deterministic, no allocation.
#pragma once

#include "equipoise/actuate/bridge.hpp"
#include "equipoise/robots/mbbr.hpp"

namespace equipoise {

struct MbbrDisturbanceParams {
  double coulomb_scale = 1.0;         // of the identified friction
  double static_ratio = 1.0;          // breakaway over Coulomb friction; 1: no Stribeck effect
  double stribeck_rate_rad_s = 0.5;   // where the difference has fallen to 1/e
  double extra_viscous_N_m_s = 0.0;   // support balls, rollers
  Vec2 yaw_friction_scale{1.0, 1.0};  // Coulomb about z for positive and negative spin
  double roller_tilt_rad = 0.0;       // of a wheel's torque axis, towards either row; (2.1)
  double rollers_per_turn = 12.0;     // of each row
  double roller_slip_N_m = 0.0;       // micro-slip: torque ripple of a wheel as rollers pass
  double backlash_rad = 0.0;          // at the wheel
  double rotor_inertia_kg_m2 = 1e-5;  // of motor and gear, at the wheel; closes the backlash
  Vec3 wheel_torque_scale = Vec3::Ones();
  double diode_drop_V = 0.0;
  double wheel_grip = 0.0;                   // friction coefficient at the ball; 0: wheels never slip
  Vec2 floor_slope_rad = Vec2::Zero();       // rise towards world x, y
  Vec3 imu_misalignment_rad = Vec3::Zero();  // rotation vector, body axes
  int sensor_latency_ticks = 0;
  int actuation_latency_steps = 0;
};

/// Mean current over stall current with diodes that drop `2 V_d`: (4.1), (4.5) in periodic steady state.
/// `opposing`: (V + 2 V_d) / V; 1 gives drive_coast_mean_current.
double drive_coast_mean_current_with_drop(double T_r, double omega_r, double u, double opposing) noexcept;

/// Largest friction torque about each body axis at these relative rates: Coulomb, Stribeck, direction of
/// spin.
Vec3 friction_limit_N_m(const MbbrDisturbanceParams& p, double mu_c, const Vec3& relative_rate_B) noexcept;

/// Contact normals of the wheels, columns, body axes.
Mat3 wheel_contacts(const MbbrParameters& robot) noexcept;

/// Which row of each wheel carries it: +1 or -1.
Vec3 roller_rows(double rollers_per_turn, const Vec3& wheel_angle_rad) noexcept;

/// Torque that grip lets a wheel pass on, and how much faster the motor then turns.
struct Grip {
  double torque_N_m = 0.0;
  double slip_rad_s = 0.0;
};
Grip limit_by_grip(double torque_N_m, double limit_N_m, double motor_damping_N_m_s) noexcept;
double grip_limit_N_m(const MbbrDisturbanceParams& p, const MbbrParameters& robot) noexcept;

/// Gap between motor and wheel. While the motor crosses it no torque passes; the encoder sits on the motor.
class Backlash {
 public:
  /// Returns the torque that reaches the wheel during this step.
  double step(const MbbrDisturbanceParams& p, double torque_N_m, double step_s) noexcept;
  /// Angle of the motor's side ahead of the wheel.
  double offset_rad() const noexcept { return offset_rad_; }

 private:
  double offset_rad_ = 0.0;
  double rate_rad_s_ = 0.0;
};

}  // namespace equipoise
