#include "robots/mbbr/drive.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace equipoise {
namespace {

/// Of each wheel's angle, in turns of its rollers: its sign chooses the row, and it makes the ripple.
Vec3 roller_sines(double rollers_per_turn, const Vec3& wheel_angle_rad) noexcept {
  return (rollers_per_turn * wheel_angle_rad).array().sin();
}

Vec3 rows_of(const Vec3& sines) noexcept {
  return (sines.array() >= 0.0).select(Vec3::Ones(), -Vec3::Ones());
}

}  // namespace

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
  return rows_of(roller_sines(rollers_per_turn, wheel_angle_rad));
}

double grip_limit_N_m(double wheel_grip, const MbbrParameters& robot) noexcept {
  const double load = robot.m_t * kGravity_m_s2 * normal_force_over_weight(robot.alpha_deg * kPi / 180.0);
  return wheel_grip * load * robot.r_w;
}

Grip limit_by_grip(double torque_N_m, double limit_N_m, double motor_damping_N_m_s) noexcept {
  const double passed = std::clamp(torque_N_m, -limit_N_m, limit_N_m);
  return {passed, (torque_N_m - passed) / motor_damping_N_m_s};
}

MbbrDrive::MbbrDrive(const MbbrParameters& robot, const MbbrDriveParams& p)
    : p_(p),
      kinematics_(robot),
      ratio_(robot.r / robot.r_w),
      wheel_radius_m_(robot.r_w),
      grip_N_m_(Vec3::Constant(grip_limit_N_m(p.wheel_grip, robot))),
      hung_(turned_by(Vec3(p.com_offset_rad.x(), p.com_offset_rad.y(), 0.0))),
      contacts_(hung_ * wheel_contacts(robot)),
      loads_from_force_(contacts_.inverse()),
      middle_(std::cos(p.roller_tilt_rad) * hung_ * kinematics_.T_ob()),
      to_row_(std::sin(p.roller_tilt_rad) * contacts_),
      tilted_(hung_ * kinematics_.T_ob()) {
  for (int i = 0; i < Mbbr::kWheels; ++i) {
    const Vec3 axis = tilted_.col(i);
    pushes_.col(i) = axis.cross(Vec3(contacts_.col(i)));
  }
}

Vec3 MbbrDrive::wheel_rates(const Vec3& relative_rate_B) const noexcept {
  if (!tilts()) return kinematics_.wheels_from_ball(relative_rate_B);
  return ratio_ * (tilted_.transpose() * relative_rate_B);
}

Vec3 MbbrDrive::wheel_torques(const Motors& motors, const Vec3& relative_rate_B) const noexcept {
  const Vec3 torque = motors.torque(wheel_rates(relative_rate_B));
  return engaged_.cwiseProduct(p_.wheel_torque_scale).cwiseProduct(torque) + ripple_N_m_;
}

Vec3 MbbrDrive::contact_torques(const Vec3& wheel_torque, const Vec3& friction_B) const noexcept {
  return wheel_torque + p_.gearbox_friction_share * kinematics_.wheels_from_axes(friction_B);
}

void MbbrDrive::begin_step(const Motors& motors, const Vec3& relative_rate_B, const Vec3& wheel_angle_rad,
                           double step_s) noexcept {
  if (tilts() || p_.roller_slip_N_m != 0.0) {
    const Vec3 sines = roller_sines(p_.rollers_per_turn, wheel_angle_rad);
    if (tilts()) tilted_ = middle_ + to_row_ * rows_of(sines).asDiagonal();
    ripple_N_m_ = p_.roller_slip_N_m * sines;
  }
  if (p_.gear.play_rad != 0.0) {
    Vec3 motor_rate = wheel_rates(relative_rate_B);
    for (int i = 0; i < Mbbr::kWheels; ++i) motor_rate(i) += gears_[static_cast<std::size_t>(i)].rate_rad_s();
    const Vec3 torque = motors.torque(motor_rate);
    for (int i = 0; i < Mbbr::kWheels; ++i) {
      engaged_(i) = gears_[static_cast<std::size_t>(i)].step(p_.gear, torque(i), step_s) ? 1.0 : 0.0;
    }
  }
}

Vec3 MbbrDrive::torque_B(const Vec3& wheel_torque, const Vec3& friction_B) const noexcept {
  Vec3 passed = wheel_torque;
  Vec3 beyond = friction_B;
  if (slips()) {
    passed = contact_torques(wheel_torque, friction_B).cwiseMin(grip_N_m_).cwiseMax(-grip_N_m_);
    beyond *= 1.0 - p_.gearbox_friction_share;
  }
  if (!tilts()) return kinematics_.axes_from_wheels(passed) + beyond;
  return ratio_ * (tilted_ * passed) + beyond;
}

void MbbrDrive::slip_over(const Motors& motors, const Vec3& wheel_torque, const Vec3& friction_B,
                          double step_s) noexcept {
  const Vec3 torque = contact_torques(wheel_torque, friction_B);
  for (int i = 0; i < Mbbr::kWheels; ++i) {
    slip_rad_(i) += limit_by_grip(torque(i), grip_N_m_(i), motors.damping_N_m_s()).slip_rad_s * step_s;
  }
}

void MbbrDrive::carry(const Vec3& body_force_B, const Vec3& wheel_torque, const Vec3& friction_B) noexcept {
  const Vec3 passed = contact_torques(wheel_torque, friction_B).cwiseMin(grip_N_m_).cwiseMax(-grip_N_m_);
  const Vec3 normal_N = loads_from_force_ * (body_force_B + pushes_ * passed / wheel_radius_m_);
  grip_N_m_ = p_.wheel_grip * wheel_radius_m_ * normal_N.cwiseMax(0.0);
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
