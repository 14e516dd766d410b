#include "robots/mbbr/scheduled_feedback.hpp"

#include <algorithm>

namespace equipoise {
namespace {

namespace gains = generated::mbbr;

/// Multiplication by a complex gain; `sign` conjugates it for negative yaw rates.
Vec2 times(const gains::Complex& k, double sign, const Vec2& v) noexcept {
  const double im = sign * k.im;
  return {k.re * v.x() - im * v.y(), im * v.x() + k.re * v.y()};
}

gains::Complex blend(const gains::Complex& a, const gains::Complex& b, double f) noexcept {
  return {a.re + f * (b.re - a.re), a.im + f * (b.im - a.im)};
}

/// Linear between rows, held beyond the last.
gains::Row row_at(double yaw_rate_magnitude) noexcept {
  std::size_t i = 0;
  while (i + 2 < gains::kRows && yaw_rate_magnitude >= gains::kScheduled[i + 1].yaw_rate_rad_s) ++i;
  const gains::Row& a = gains::kScheduled[i];
  const gains::Row& b = gains::kScheduled[i + 1];
  const double f =
      std::clamp((yaw_rate_magnitude - a.yaw_rate_rad_s) / (b.yaw_rate_rad_s - a.yaw_rate_rad_s), 0.0, 1.0);
  return {yaw_rate_magnitude, blend(a.theta, b.theta, f), blend(a.phi, b.phi, f),
          blend(a.body_rate, b.body_rate, f), blend(a.phi_dot, b.phi_dot, f)};
}

}  // namespace

Vec3 MbbrScheduledFeedback::update(const MbbrReference& ref) const noexcept {
  const double sign = std::copysign(1.0, ref.yaw_rate);
  const gains::Row k = row_at(std::abs(ref.yaw_rate));
  // The thesis' lean reference is not ours: back to the estimates.
  const Vec2 theta = ref.theta_xy - ref.d_theta;
  const Vec2 body_rate = ref.rate_xy - ref.d_rate;

  const Vec2 feedback = times(k.theta, sign, theta - gains::kLean * ref.phi_ddot_star) -
                        times(k.phi, sign, ref.d_phi) + times(k.body_rate, sign, body_rate) -
                        times(k.phi_dot, sign, ref.d_phi_dot_unfiltered);
  const Vec2 feedforward = times({gains::kSpeed, -gains::kSpeedTurn * ref.yaw_rate}, 1.0, ref.phi_dot_star) +
                           gains::kDrive * ref.phi_ddot_star;
  const Vec2 u = feedback + feedforward;
  const double yaw_feedforward = p_.yaw_feedforward ? gains::kYawFeedforward * ref.yaw_rate : 0.0;
  const double u_z = yaw_feedforward - gains::kYawAngle * ref.d_theta_z - gains::kYawRate * ref.d_yaw_rate;
  return {u.x(), u.y(), u_z};
}

}  // namespace equipoise
