#include "robots/mip/reference.hpp"

#include <algorithm>

namespace equipoise {

StateView view(const MipReference& ref, const MipParameters&) noexcept {
  StateView v;
  v.theta_rad << 0.0, 0.0, ref.psi;
  v.omega_B_rad_s << 0.0, 0.0, ref.psi_dot;
  v.phi_rad << ref.phi, 0.0;
  v.phi_dot_rad_s << ref.phi_dot, 0.0;
  v.position_W_m = ref.position_W_m;
  return v;
}

void MipReferenceStage::reset(const MipEstimate& x_hat) noexcept {
  drive_.reset();
  yaw_rate_ = 0.0;
  phi_ref_ = x_hat.phi;
  psi_ref_ = x_hat.psi;
  position_W_m_ = x_hat.position_W_m;
  restart_ = true;
}

MipReference MipReferenceStage::update(const Command& command, const MipEstimate& x_hat) noexcept {
  const double yaw_step = p_.max_yaw_acceleration_rad_s2 * kTickS;
  const double yaw_target = p_.budget.allowed_yaw_rate(command.yaw_rate_rad_s);
  yaw_rate_ += std::clamp(yaw_target - yaw_rate_, -yaw_step, yaw_step);
  // Room for the travel beside the turn that is there and the one that is wanted.
  const double room = p_.budget.allowed_speed(std::max(std::abs(yaw_rate_), std::abs(yaw_target)));
  const Vec<1> feasible(std::clamp(command.velocity_W_m_s.x(), -room, room));
  drive_.update(feasible,
                {std::min(p_.max_acceleration_m_s2, p_.feasible_acceleration_m_s2), p_.max_jerk_m_s3});
  const double speed_m_s = drive_.velocity()(0);

  MipReference ref;
  ref.phi_dot = speed_m_s / p_.wheel_radius_m;
  ref.psi_dot = yaw_rate_;
  phi_ref_ += kTickS * ref.phi_dot;
  phi_ref_ = std::clamp(phi_ref_, x_hat.phi - p_.max_phi_error_rad, x_hat.phi + p_.max_phi_error_rad);
  psi_ref_ += kTickS * yaw_rate_;
  position_W_m_ += kTickS * rotate(psi_ref_, Vec2(0.0, -speed_m_s));
  ref.phi = phi_ref_;
  ref.psi = psi_ref_;
  ref.position_W_m = position_W_m_;

  ref.d_theta = -x_hat.theta;
  ref.d_theta_dot = -x_hat.theta_dot;
  ref.d_phi = phi_ref_ - x_hat.phi;
  ref.d_phi_dot = ref.phi_dot - x_hat.phi_dot;
  ref.d_psi = psi_ref_ - x_hat.psi;
  ref.d_psi_dot = yaw_rate_ - x_hat.psi_dot;
  ref.restart = restart_;
  restart_ = false;
  return ref;
}

}  // namespace equipoise
