#include "robots/mbbr/dynamics.hpp"

#include <Eigen/Geometry>

namespace equipoise {
namespace {

/// R of the tilt alone, yaw frame <- body: Ry(theta_y) Rx(theta_x).
Mat3 tilt_rotation(const MbbrMotion& m) noexcept {
  Mat3 R;
  R << m.cy(), m.sy() * m.sx(), m.sy() * m.cx(), 0.0, m.cx(), -m.sx(), -m.sy(), m.cy() * m.sx(),
      m.cy() * m.cx();
  return R;
}

}  // namespace

Vec3 MbbrMotion::theta_dot() const noexcept {
  const double z = (sx_ * omega_B.y() + cx_ * omega_B.z()) / cy_;
  return {omega_B.x() + sy_ * z, cx_ * omega_B.y() - sx_ * omega_B.z(), z};
}

MbbrDynamics::MbbrDynamics(const MbbrParameters& p) noexcept
    : p_(p),
      body_inertia_(p.I_t1 + p.m_t * p.l * p.l + p.I_w, p.I_t2 + p.m_t * p.l * p.l + p.I_w, p.I_t3 + p.I_w),
      ball_inertia_(p.I_b + p.I_w + (p.m_b + p.m_t) * p.r * p.r) {}

// With c = (0, 0, l), alpha the ball's inertial angular acceleration (two components, yaw frame), S the map
// phi' -> ball velocity / r, P = [e1 e2] and C = m_t [c]x R^T r S - I_w R^T P, Kane's equations are
//   diag(body_inertia) Omega' + C alpha = b_body,   C^T Omega' + ball_inertia alpha = b_ball.
MbbrAccelerations MbbrDynamics::accelerations(const MbbrMotion& m, const Vec3& tau_B, const Vec3& push_B,
                                              const Vec2& pull_star) const noexcept {
  const Mat3 R = tilt_rotation(m);
  const Vec3& w = m.omega_B;
  const double ml = p_.m_t * p_.l;

  // Rows of R are the yaw frame's axes in body components; [c]x v = l (-v_y, v_x, 0).
  const Vec3 e1 = R.row(0);
  const Vec3 e2 = R.row(1);
  const double mlr = ml * p_.r;
  Mat<3, 2> C;  // S maps phi_x' to -e2 and phi_y' to e1
  C.col(0) = Vec3(mlr * e2.y(), -mlr * e2.x(), 0.0) - p_.I_w * e1;
  C.col(1) = Vec3(-mlr * e1.y(), mlr * e1.x(), 0.0) - p_.I_w * e2;

  const Vec3 ball_rate_B = e1 * m.phi_dot_star.x() + e2 * m.phi_dot_star.y();
  const Vec3 wheel_gyroscopic = p_.I_w * w.cross(ball_rate_B);
  const Vec3 centripetal = ml * Vec3(w.x() * w.z(), w.y() * w.z(), -(w.x() * w.x() + w.y() * w.y()));
  const Vec3 I_t(p_.I_t1, p_.I_t2, p_.I_t3);
  const Vec3 up_B = R.row(2);

  const Vec3 on_body = push_B - centripetal;
  const Vec3 b_body = -w.cross(I_t.cwiseProduct(w)) + p_.l * Vec3(-on_body.y(), on_body.x(), 0.0) -
                      ml * kGravity_m_s2 * Vec3(-up_B.y(), up_B.x(), 0.0) - wheel_gyroscopic - tau_B;
  const Vec3 on_ball = wheel_gyroscopic + tau_B;
  const Vec2 b_ball(-p_.r * (e2.dot(on_body) + pull_star.y()) + e1.dot(on_ball),
                    p_.r * (e1.dot(on_body) + pull_star.x()) + e2.dot(on_ball));

  const Vec3 inverse = body_inertia_.cwiseInverse();
  const Mat<3, 2> DC = inverse.asDiagonal() * C;
  const double s11 = ball_inertia_ - C.col(0).dot(DC.col(0));
  const double s22 = ball_inertia_ - C.col(1).dot(DC.col(1));
  const double s12 = -C.col(0).dot(DC.col(1));
  const Vec2 rhs = b_ball - DC.transpose() * b_body;
  const double det = s11 * s22 - s12 * s12;
  MbbrAccelerations a;
  a.phi_ddot_inertial = Vec2(s22 * rhs.x() - s12 * rhs.y(), s11 * rhs.y() - s12 * rhs.x()) / det;
  a.omega_dot_B = inverse.cwiseProduct(b_body - C * a.phi_ddot_inertial);
  return a;
}

Vec3 MbbrDynamics::encoder_rate_B(const MbbrMotion& m) noexcept {
  const Mat3 R = tilt_rotation(m);
  return R.transpose().leftCols<2>() * m.phi_dot_star - m.omega_B;
}

Vec3 MbbrDynamics::accelerometer_B(const MbbrMotion& m, const MbbrAccelerations& a) const noexcept {
  const Mat3 R = tilt_rotation(m);
  const Vec2 ball = ball_velocity(p_.r, a.phi_ddot_inertial);
  const Vec3 gravity_minus_ball(-ball.x(), -ball.y(), -kGravity_m_s2);
  return R.transpose() * gravity_minus_ball - a.omega_dot_B.cross(p_.l_a) -
         m.omega_B.cross(m.omega_B.cross(p_.l_a));
}

Vec2 MbbrDynamics::phi_star_ddot(const MbbrMotion& m, const MbbrAccelerations& a) noexcept {
  const double yaw_rate = m.theta_dot().z();
  return a.phi_ddot_inertial + yaw_rate * Vec2(m.phi_dot_star.y(), -m.phi_dot_star.x());
}

Vec3 MbbrDynamics::theta_ddot(const MbbrMotion& m, const MbbrAccelerations& a) noexcept {
  const Vec3 rate = m.theta_dot();
  const Vec3& w_dot = a.omega_dot_B;
  const double y = m.cx() * w_dot.y() - m.sx() * w_dot.z() - rate.x() * rate.z() * m.cy();
  const double z =
      (m.sx() * w_dot.y() + m.cx() * w_dot.z() + rate.x() * rate.y() + rate.y() * rate.z() * m.sy()) / m.cy();
  return {w_dot.x() + m.cy() * rate.y() * rate.z() + m.sy() * z, y, z};
}

Vec3 MbbrDynamics::relative_mobility() const noexcept {
  const MbbrMotion rest;
  const MbbrAccelerations zero = accelerations(rest, Vec3::Zero());
  Vec3 mobility;
  for (int axis = 0; axis < 3; ++axis) {
    const MbbrAccelerations a = accelerations(rest, Vec3::Unit(axis));
    const Vec3 ball(a.phi_ddot_inertial.x() - zero.phi_ddot_inertial.x(),
                    a.phi_ddot_inertial.y() - zero.phi_ddot_inertial.y(), 0.0);
    mobility(axis) = (ball - (a.omega_dot_B - zero.omega_dot_B))(axis);
  }
  return mobility;
}

}  // namespace equipoise
