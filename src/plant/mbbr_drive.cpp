#include "equipoise/plant/mbbr_drive.hpp"

namespace equipoise {

MbbrDrive::MbbrDrive(const MbbrParameters& robot, const MotorParameters& motor,
                     const MbbrDisturbanceParams& p)
    : p_(p),
      motor_(motor),
      ratio_(robot.r / robot.r_w),
      axes_(MbbrKinematics(robot).T_ob()),
      contacts_(wheel_contacts(robot)),
      tilted_(axes_),
      grip_N_m_(grip_limit_N_m(p, robot)) {}

double MbbrDrive::motor_torque(double duty, double wheel_rate_rad_s, double supply_V) const noexcept {
  const double omega_r = wheel_rate_rad_s / motor_.no_load_rad_s(supply_V);
  double current = duty - omega_r;
  if (motor_.bridge == BridgeType::kDriveCoast) {
    current = p_.diode_drop_V == 0.0
                  ? drive_coast_mean_current(motor_.T_r(), omega_r, duty)
                  : drive_coast_mean_current_with_drop(motor_.T_r(), omega_r, duty,
                                                       1.0 + 2.0 * p_.diode_drop_V / supply_V);
  }
  return motor_.torque_constant_N_m_A * motor_.stall_current_A(supply_V) * current;
}

void MbbrDrive::begin_step(const StepStart& s) noexcept {
  if (p_.roller_tilt_rad != 0.0) {
    const Vec3 rows = roller_rows(p_.rollers_per_turn, s.wheel_angle_rad);
    tilted_ =
        std::cos(p_.roller_tilt_rad) * axes_ + std::sin(p_.roller_tilt_rad) * contacts_ * rows.asDiagonal();
  }
  if (p_.roller_slip_N_m != 0.0) {
    ripple_N_m_ = p_.roller_slip_N_m * (p_.rollers_per_turn * s.wheel_angle_rad).array().sin().matrix();
  }
  if (p_.backlash_rad == 0.0 && p_.wheel_grip == 0.0) return;
  const Vec3 wheel_rate = ratio_ * (tilted_.transpose() * s.relative_rate_B);
  for (int i = 0; i < 3; ++i) {
    const double torque = motor_torque(s.duty(i), wheel_rate(i), s.supply_V);
    if (p_.backlash_rad != 0.0) {
      const double passed = gaps_[static_cast<std::size_t>(i)].step(p_, torque, s.step_s);
      engaged_(i) = passed == torque ? 1.0 : 0.0;
    }
    if (p_.wheel_grip != 0.0) {
      slip_rad_(i) += limit_by_grip(engaged_(i) * torque, grip_N_m_, motor_.k2()).slip_rad_s * s.step_s;
    }
  }
}

Vec3 MbbrDrive::torque_B(const Vec3& relative_rate_B, const Vec3& duty, double supply_V) const noexcept {
  const Vec3 wheel_rate = ratio_ * (tilted_.transpose() * relative_rate_B);
  Vec3 torque;
  for (int i = 0; i < 3; ++i) {
    torque(i) = engaged_(i) * p_.wheel_torque_scale(i) * motor_torque(duty(i), wheel_rate(i), supply_V) +
                ripple_N_m_(i);
    if (p_.wheel_grip != 0.0) torque(i) = limit_by_grip(torque(i), grip_N_m_, motor_.k2()).torque_N_m;
  }
  return ratio_ * (tilted_ * torque);
}

Vec3 MbbrDrive::seen_rate_B(const Vec3& relative_rate_B) const noexcept {
  return axes_ * (tilted_.transpose() * relative_rate_B);
}

Vec3 MbbrDrive::encoder_offset_rad() const noexcept {
  Vec3 offset = slip_rad_;
  for (int i = 0; i < 3; ++i) offset(i) += gaps_[static_cast<std::size_t>(i)].offset_rad();
  return offset;
}

}  // namespace equipoise
