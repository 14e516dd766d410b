#include "robots/mbbr/scheduled_feedback.hpp"

namespace equipoise {
namespace {

/// Multiplication by a complex number.
Vec2 times(double re, double im, const Vec2& v) noexcept {
  return {re * v.x() - im * v.y(), im * v.x() + re * v.y()};
}

}  // namespace

Vec3 MbbrScheduledFeedback::update(const MbbrReference& ref) noexcept {
  const MbbrGains& g = p_.gains;
  const double sign = std::copysign(1.0, ref.yaw_rate);
  const auto row = g.schedule(std::abs(ref.yaw_rate));
  const auto gain = [&row, sign](MbbrGains::Gain k, const Vec2& v) {
    return times(row[2 * k], sign * row[2 * k + 1], v);
  };
  // The thesis' lean reference is not ours: back to the estimates.
  const Vec2 theta = ref.theta_xy - ref.d_theta;
  const Vec2 body_rate = ref.rate_xy - ref.d_rate;

  const Vec2 feedback =
      gain(MbbrGains::kTheta, theta - g.lean * ref.phi_ddot_star) - gain(MbbrGains::kPhi, ref.d_phi) +
      gain(MbbrGains::kBodyRate, body_rate - g.lean * ref.phi_dddot_star) -
      gain(MbbrGains::kPhiDot, ref.d_phi_dot_unfiltered) + gain(MbbrGains::kUBefore, d_u_before_);
  const Vec2 feedforward =
      times(g.speed, -g.speed_turn * ref.yaw_rate, ref.phi_dot_star) + g.drive * ref.phi_ddot_star;
  d_u_before_ = feedback.allFinite() ? feedback : Vec2(Vec2::Zero());  // one NaN is not for ever
  const Vec2 u = feedback + feedforward;
  const double yaw_feedforward = p_.yaw_feedforward ? g.yaw_feedforward * ref.yaw_rate : 0.0;
  const double u_z = yaw_feedforward - g.yaw_angle * ref.d_theta_z - g.yaw_rate * ref.d_yaw_rate;
  return {u.x(), u.y(), u_z};
}

}  // namespace equipoise
