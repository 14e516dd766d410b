#include "robots/mbbr/reference.hpp"

namespace equipoise {
StateView view(const MbbrReference& ref, const MbbrParameters& p) noexcept {
  StateView v;
  v.theta_rad << ref.theta_xy, ref.theta_z;
  v.omega_B_rad_s << ref.rate_xy, ref.yaw_rate;
  v.phi_rad = ref.phi;
  v.phi_dot_rad_s = ref.phi_dot_star;
  v.position_W_m = ball_velocity(p.r, ref.phi);
  return v;
}

void MbbrReferenceStage::reset(const MbbrEstimate& x_hat) noexcept {
  heading_zero_ = Turn(x_hat.theta_z);
  drive_W_.reset();
  yaw_rate_ = 0.0;
  phi_ref_ = x_hat.phi;
  theta_z_ref_ = x_hat.theta_z;
  lean_.setZero();
  low_pass_.setZero();
  lean_previous_.setZero();
}

MbbrReference MbbrReferenceStage::update(const Command& command, const MbbrEstimate& x_hat) noexcept {
  if (command.heading_reset) heading_zero_ = Turn(x_hat.theta_z);

  // (6.11)
  const double yaw_step = p_.yaw_acceleration_rad_s2() * kTickS;
  const double yaw_target = p_.budget.allowed_yaw_rate(command.yaw_rate_rad_s);
  yaw_rate_ += std::clamp(yaw_target - yaw_rate_, -yaw_step, yaw_step);
  // Room for the travel beside the turn that is there and the one that is wanted.
  const double room = p_.budget.allowed_speed(std::max(std::abs(yaw_rate_), std::abs(yaw_target)));
  const double asked = command.velocity_W_m_s.norm();
  const Vec2 feasible = asked > room ? Vec2(command.velocity_W_m_s * (room / asked)) : command.velocity_W_m_s;
  drive_W_.update(heading_zero_(feasible),
                  {std::min(p_.max_acceleration_m_s2, p_.feasible_acceleration_m_s2), p_.max_jerk_m_s3});
  const Vec2 phi_dot_ref = ball_rate(p_.ball_radius_m, drive_W_.velocity());
  phi_ref_ += phi_dot_ref * kTickS;
  theta_z_ref_ += yaw_rate_ * kTickS;

  const auto row = p_.schedule(std::abs(yaw_rate_));
  const Turn heading(x_hat.theta_z);
  const bool inertial = p_.frame == FilterFrame::kInertial;

  MbbrReference ref;
  ref.phi = phi_ref_;
  ref.theta_z = theta_z_ref_;
  ref.yaw_rate = yaw_rate_;
  ref.d_phi = heading.back(phi_ref_ - x_hat.phi);  // (6.8)
  ref.phi_dot_star = heading.back(phi_dot_ref);
  ref.phi_ddot_star = heading.back(ball_rate(p_.ball_radius_m, drive_W_.acceleration()));
  ref.phi_dddot_star = heading.back(ball_rate(p_.ball_radius_m, drive_W_.jerk()));
  ref.d_phi_dot_unfiltered = ref.phi_dot_star - x_hat.phi_dot_star;  // (6.9)
  const Vec2 rate_error = inertial ? heading(ref.d_phi_dot_unfiltered) : ref.d_phi_dot_unfiltered;

  // First-order low-pass, exact for a held input.
  const double blend = 1.0 - std::exp(-row[MbbrReferenceParams::kLowPassRadS] * kTickS);
  low_pass_ += blend * (rate_error - low_pass_);
  ref.d_phi_dot = inertial ? heading.back(low_pass_) : low_pass_;

  // (6.13): the lean of this tick follows from the errors up to the last one.
  ref.theta_xy = inertial ? heading.back(lean_) : lean_;
  // (6.12). In the inertial frame the change of the lean is, resolved in the yaw frame, the body rate it asks
  // for.
  const bool body = p_.rate_feedback == RateFeedback::kBody;
  const Vec2 lean_now = body ? heading(ref.theta_xy) : ref.theta_xy;
  const Vec2 lean_rate = (lean_now - lean_previous_) / kTickS;
  lean_previous_ = lean_now;
  ref.rate_xy = body ? heading.back(lean_rate) : lean_rate;
  lean_ = row[MbbrReferenceParams::kSlcPole] * lean_ +
          p_.slc_sign * row[MbbrReferenceParams::kSlcGain] * p_.slc_unit * rate_error;

  ref.d_theta = ref.theta_xy - x_hat.theta_xy;  // (6.7)
  ref.d_rate = ref.rate_xy - (body ? x_hat.omega_B.head<2>() : x_hat.theta_dot.head<2>());
  ref.d_theta_z = theta_z_ref_ - x_hat.theta_z;
  ref.d_yaw_rate = yaw_rate_ - x_hat.theta_dot.z();
  return ref;
}

}  // namespace equipoise
