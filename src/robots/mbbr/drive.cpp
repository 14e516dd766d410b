#include "robots/mbbr/drive.hpp"

#include <Eigen/Dense>

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

MbbrDrive::MbbrDrive(const MbbrParameters& robot, const MbbrDriveParams& p)
    : p_(p),
      kinematics_(robot),
      ratio_(robot.r / robot.r_w),
      wheel_radius_m_(robot.r_w),
      rotor_inertia_kg_m2_(robot.I_w / (ratio_ * ratio_)),
      // [T] section 5.3 identified the friction of all three gears about x, and about y.
      gear_share_(p.gearbox_friction_share /
                  (ratio_ * 0.5 * kinematics_.T_ob().topRows<2>().cwiseAbs().sum())),
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
  if (!tilts()) return kinematics_.axes_from_wheels(wheel_torque) + friction_B;
  if (!slips()) return ratio_ * (tilted_ * wheel_torque) + friction_B;
  return ratio_ * (tilted_ * contact_torques(wheel_torque, friction_B)) + share_beyond() * friction_B;
}

bool MbbrDrive::carries(const Vec3& wheel_torque, const Vec3& friction_B,
                        const Vec3& relative_acceleration_B) const noexcept {
  if (!slips()) return true;
  const Vec3 turns = rotor_inertia_kg_m2_ * wheel_rates(relative_acceleration_B);
  const Vec3 contacts = contact_torques(wheel_torque, friction_B) - turns;
  return (contacts.array().abs() <= grip_N_m_.array()).all();
}

/// Implicit in the motors' back-EMF, which stops a free rotor within about a step.
MbbrRotors MbbrDrive::rotors(const Motors& motors, const Vec3& rates, double coulomb_N_m,
                             const Stiction& stiction, double viscous, double step_s) const noexcept {
  const Vec3 motor = p_.wheel_torque_scale.cwiseProduct(engaged_);
  const Vec3 damping = motors.enabled() ? Vec3(motors.damping_N_m_s() * motor) : Vec3(Vec3::Zero());
  const Vec3 torque = motor.cwiseProduct(motors.torque(rates)) + ripple_N_m_;
  const double inertia = rotor_inertia_kg_m2_ / step_s;
  const double rubs = p_.gearbox_friction_share * viscous / (ratio_ * ratio_);
  MbbrRotors r;
  r.loose = slips();
  r.axes_B = ratio_ * tilted_;
  r.compliance = (damping.array() + inertia + rubs).inverse();
  r.free_rad_s = r.compliance.cwiseProduct(inertia * rates + torque + damping.cwiseProduct(rates));
  for (int i = 0; i < Mbbr::kWheels; ++i) {
    r.gear_N_m(i) = gear_share_ * coulomb_N_m * stiction.factor(rates(i) / ratio_);
  }
  r.grip_N_m = grip_N_m_;
  return r;
}

void MbbrDrive::carry(const Vec3& body_force_B, const Vec3& contact_torques) noexcept {
  const Vec3 normal_N = loads_from_force_ * (body_force_B + pushes_ * contact_torques / wheel_radius_m_);
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
