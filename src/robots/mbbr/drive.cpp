#include "robots/mbbr/drive.hpp"

#include <Eigen/Dense>

namespace equipoise {

Mat3 wheel_contacts(const MbbrParameters& robot) noexcept {
  const double alpha = robot.alpha_deg * kPi / 180.0;
  const Vec3 first(-std::sin(alpha), 0.0, std::cos(alpha));
  Mat3 contacts;
  for (int i = 0; i < Mbbr::kWheels; ++i) {
    contacts.col(i) =
        Eigen::AngleAxisd(robot.azimuth_deg * kPi / 180.0 + 2.0 * kPi / 3.0 * i, Vec3::UnitZ()) * first;
  }
  return contacts;
}

Vec3 roller_rows(double rollers_per_turn, const Vec3& wheel_angle_rad) noexcept {
  Vec3 rows;
  for (int i = 0; i < 3; ++i) rows(i) = std::sin(rollers_per_turn * wheel_angle_rad(i)) >= 0.0 ? 1.0 : -1.0;
  return rows;
}

MbbrDrive::MbbrDrive(const MbbrParameters& robot, const MbbrDriveParams& p)
    : p_(p),
      kinematics_(robot),
      ratio_(robot.r / robot.r_w),
      wheel_radius_m_(robot.r_w),
      contacts_(wheel_contacts(robot)),
      loads_from_force_(contacts_.inverse()),
      tilted_(kinematics_.T_ob()) {
  for (int i = 0; i < Mbbr::kWheels; ++i) {
    const Vec3 axis = kinematics_.T_ob().col(i);
    pushes_.col(i) = axis.cross(Vec3(contacts_.col(i)));
  }
}

Vec3 MbbrDrive::wheel_rates(const Vec3& relative_rate_B) const noexcept {
  if (!tilts()) return kinematics_.wheels_from_ball(relative_rate_B);
  return ratio_ * (tilted_.transpose() * relative_rate_B);
}

Vec3 MbbrDrive::wheel_torques(const Motors& motors, const Vec3& relative_rate_B) const noexcept {
  const Vec3 torque = motors.torque(wheel_rates(relative_rate_B) + slip_rad_s_);
  return engaged_.cwiseProduct(p_.wheel_torque_scale).cwiseProduct(torque) + ripple_N_m_;
}

Vec3 MbbrDrive::contact_torques(const Vec3& wheel_torque, const Vec3& friction_B) const noexcept {
  return wheel_torque + p_.gearbox_friction_share * kinematics_.wheels_from_axes(friction_B);
}

void MbbrDrive::begin_step(const Motors& motors, const Vec3& relative_rate_B, const Vec3& wheel_angle_rad,
                           double step_s) noexcept {
  if (tilts()) {
    const Vec3 rows = roller_rows(p_.rollers_per_turn, wheel_angle_rad);
    tilted_ = std::cos(p_.roller_tilt_rad) * kinematics_.T_ob() +
              std::sin(p_.roller_tilt_rad) * contacts_ * rows.asDiagonal();
  }
  if (p_.roller_slip_N_m != 0.0) {
    ripple_N_m_ = p_.roller_slip_N_m * (p_.rollers_per_turn * wheel_angle_rad).array().sin().matrix();
  }
  if (p_.gear.play_rad != 0.0) {
    Vec3 motor_rate = wheel_rates(relative_rate_B) + slip_rad_s_;
    for (int i = 0; i < Mbbr::kWheels; ++i) motor_rate(i) += gears_[static_cast<std::size_t>(i)].rate_rad_s();
    const Vec3 torque = motors.torque(motor_rate);
    for (int i = 0; i < Mbbr::kWheels; ++i) {
      engaged_(i) = gears_[static_cast<std::size_t>(i)].step(p_.gear, torque(i), step_s) ? 1.0 : 0.0;
    }
  }
}

Vec3 MbbrDrive::torque_B(const Vec3& wheel_torque, const Vec3& friction_B) const noexcept {
  const Vec3 passed = wheel_torque - lost_N_m_;
  if (!tilts()) return kinematics_.axes_from_wheels(passed) + friction_B;
  return ratio_ * (tilted_ * passed) + friction_B;
}

Vec3 MbbrDrive::loads_N(const Vec3& body_force_B, const Vec3& passed_N_m) const noexcept {
  return loads_from_force_ * (body_force_B + pushes_ * passed_N_m / wheel_radius_m_);
}

bool MbbrDrive::settle(const Vec3& contact_torque, const WheelLoads& loads, const Motors& motors,
                       double step_s) noexcept {
  // The motor's damping acts within the step: no step is too long for a light rotor.
  const double inertia = p_.gear.rotor_inertia_kg_m2 + step_s * motors.damping_N_m_s();
  const Vec3 sticking = contact_torque + inertia / step_s * slip_rad_s_;
  const Vec3 passed = passed_on(sticking, loads, p_.wheel_grip * wheel_radius_m_);
  const Vec3 lost = contact_torque - passed;
  next_slip_rad_s_ = step_s / inertia * (sticking - passed);
  const bool changed = lost != lost_N_m_;
  lost_N_m_ = lost;
  return changed;
}

void MbbrDrive::end_step(double step_s) noexcept {
  slip_rad_s_ = next_slip_rad_s_;
  slip_rad_ += step_s * slip_rad_s_;
}

Vec3 MbbrDrive::seen_rate_B(const Vec3& relative_rate_B) const noexcept {
  if (!tilts()) return relative_rate_B;
  return kinematics_.T_ob() * (tilted_.transpose() * relative_rate_B);
}

Vec3 MbbrDrive::encoder_offset_rad() const noexcept {
  Vec3 offset = slip_rad_;
  for (int i = 0; i < Mbbr::kWheels; ++i) offset(i) += gears_[static_cast<std::size_t>(i)].ahead_rad();
  return offset;
}

}  // namespace equipoise
