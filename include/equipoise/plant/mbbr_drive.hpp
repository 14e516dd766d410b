// The MBBR's drive as built: three motors, gaps, double-row wheels that hold the ball with one row at a time.
// In: what each step starts with -> out: torque on the ball, and the rates that the encoders see.
// Source: [T] (2.1), section 2.3.1. Simulation only; deterministic, no allocation.
#pragma once

#include <array>

#include "equipoise/plant/mbbr_disturbance.hpp"

namespace equipoise {

class MbbrDrive {
 public:
  MbbrDrive(const MbbrParameters& robot, const MotorParameters& motor, const MbbrDisturbanceParams& p);

  struct StepStart {
    Vec3 relative_rate_B;
    Vec3 wheel_angle_rad;
    Vec3 duty;
    double supply_V;
    double step_s;
  };
  /// Rows, gaps and slip are held over a step.
  void begin_step(const StepStart& s) noexcept;

  /// Torque of the motors on the ball, body axes.
  Vec3 torque_B(const Vec3& relative_rate_B, const Vec3& duty, double supply_V) const noexcept;
  /// Rate of the ball as the wheels' axes report it.
  Vec3 seen_rate_B(const Vec3& relative_rate_B) const noexcept;
  /// What gap and slip add to the motors' angles.
  Vec3 encoder_offset_rad() const noexcept;

 private:
  double motor_torque(double duty, double wheel_rate_rad_s, double supply_V) const noexcept;

  MbbrDisturbanceParams p_;
  MotorParameters motor_;
  double ratio_;
  Mat3 axes_;      // of the wheels, columns
  Mat3 contacts_;  // normals, columns
  Mat3 tilted_;    // axes of the rows that carry now
  double grip_N_m_;
  Vec3 engaged_ = Vec3::Ones();
  Vec3 ripple_N_m_ = Vec3::Zero();
  Vec3 slip_rad_ = Vec3::Zero();
  std::array<Backlash, 3> gaps_;
};

}  // namespace equipoise
