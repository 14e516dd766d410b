#include "equipoise/plant/mbbr_disturbance.hpp"

#include <algorithm>

namespace equipoise {

// In units of the stall current and the PWM period. Volt-seconds over one period balance:
//   i_avg = (1 - omega_r) v - (opposing + omega_r) t_c,
// with t_c the share of the period in which the diodes conduct.
double drive_coast_mean_current_with_drop(double T_r, double omega_r, double u, double opposing) noexcept {
  if (u == 0.0) return 0.0;
  const double sign = u < 0.0 ? -1.0 : 1.0;
  const double w = sign * std::clamp(omega_r, -1.0, 1.0);
  const double v = std::min(std::abs(u), 1.0);
  const double peak = (1.0 - w) * -std::expm1(-v * T_r);
  const double dies_after = std::log1p(peak / (opposing + w)) / T_r;
  return sign * ((1.0 - w) * v - (opposing + w) * std::min(dies_after, 1.0 - v));
}

Vec3 friction_limit_N_m(const MbbrDisturbanceParams& p, double mu_c, const Vec3& relative_rate_B) noexcept {
  Vec3 limit = Vec3::Constant(mu_c * p.coulomb_scale);
  limit.z() *= relative_rate_B.z() >= 0.0 ? p.yaw_friction_scale.x() : p.yaw_friction_scale.y();
  if (p.static_ratio != 1.0) {
    for (int i = 0; i < 3; ++i) {
      const double slow = relative_rate_B(i) / p.stribeck_rate_rad_s;
      limit(i) *= 1.0 + (p.static_ratio - 1.0) * std::exp(-slow * slow);
    }
  }
  return limit;
}

Mat3 wheel_contacts(const MbbrParameters& robot) noexcept {
  const double alpha = robot.alpha_deg * kPi / 180.0;
  const Vec3 first(-std::sin(alpha), 0.0, std::cos(alpha));
  Mat3 contacts;
  for (int i = 0; i < 3; ++i) {
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

double grip_limit_N_m(const MbbrDisturbanceParams& p, const MbbrParameters& robot) noexcept {
  const double load = robot.m_t * kGravity_m_s2 * normal_force_over_weight(robot.alpha_deg * kPi / 180.0);
  return p.wheel_grip * load * robot.r_w;
}

Grip limit_by_grip(double torque_N_m, double limit_N_m, double motor_damping_N_m_s) noexcept {
  const double passed = std::clamp(torque_N_m, -limit_N_m, limit_N_m);
  return {passed, (torque_N_m - passed) / motor_damping_N_m_s};
}

double Backlash::step(const MbbrDisturbanceParams& p, double torque_N_m, double step_s) noexcept {
  const double half = 0.5 * p.backlash_rad;
  const bool pressed = torque_N_m >= 0.0 ? offset_rad_ >= half : offset_rad_ <= -half;
  if (pressed) {
    rate_rad_s_ = 0.0;
    return torque_N_m;
  }
  rate_rad_s_ += torque_N_m / p.rotor_inertia_kg_m2 * step_s;
  offset_rad_ += rate_rad_s_ * step_s;
  if (std::abs(offset_rad_) >= half) {
    offset_rad_ = std::copysign(half, offset_rad_);
    rate_rad_s_ = 0.0;
  }
  return 0.0;
}

}  // namespace equipoise
