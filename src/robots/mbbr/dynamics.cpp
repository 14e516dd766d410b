#include "robots/mbbr/dynamics.hpp"

namespace equipoise {

MbbrDynamics::MbbrDynamics(const MbbrParameters& p) noexcept
    : p_(p),
      inverse_body_inertia_(
          Vec3(p.I_t1 + p.m_t * p.l * p.l + p.I_w, p.I_t2 + p.m_t * p.l * p.l + p.I_w, p.I_t3 + p.I_w)
              .cwiseInverse()),
      ball_inertia_(p.I_b + p.I_w + (p.m_b + p.m_t) * p.r * p.r) {}

// With c = (0, 0, l), alpha the ball's inertial angular acceleration (two components, yaw frame), S the map
// phi' -> ball velocity / r, P = [e1 e2] and C = m_t [c]x R^T r S - I_w R^T P, Kane's equations are
//   diag(body_inertia) Omega' + C alpha = b_body,   C^T Omega' + ball_inertia alpha = b_ball.
MbbrMass MbbrDynamics::mass(const Motion& m) const noexcept {
  const auto& R = m.R();
  const double mlr =
      p_.m_t * p_.l * p_.r;  // [c]x v = l (-v_y, v_x, 0); S maps phi_x' to -e2 and phi_y' to e1
  Mass mass;
  mass.C << mlr * R(1, 1) - p_.I_w * R(0, 0), -mlr * R(0, 1) - p_.I_w * R(1, 0),  //
      -mlr * R(1, 0) - p_.I_w * R(0, 1), mlr * R(0, 0) - p_.I_w * R(1, 1),        //
      -p_.I_w * R(0, 2), -p_.I_w * R(1, 2);
  mass.DC = inverse_body_inertia_.asDiagonal() * mass.C;
  mass.s11 = ball_inertia_ - mass.C.col(0).dot(mass.DC.col(0));
  mass.s22 = ball_inertia_ - mass.C.col(1).dot(mass.DC.col(1));
  mass.s12 = -mass.C.col(0).dot(mass.DC.col(1));
  mass.det = mass.s11 * mass.s22 - mass.s12 * mass.s12;
  return mass;
}

MbbrAccelerations MbbrDynamics::solve(const Mass& mass, const Vec3& b_body,
                                      const Vec2& b_ball) const noexcept {
  const Vec2 rhs = b_ball - mass.DC.transpose() * b_body;
  Accelerations a;
  a.phi_ddot_inertial =
      Vec2(mass.s22 * rhs.x() - mass.s12 * rhs.y(), mass.s11 * rhs.y() - mass.s12 * rhs.x()) / mass.det;
  a.omega_dot_B = inverse_body_inertia_.cwiseProduct(b_body - mass.C * a.phi_ddot_inertial);
  return a;
}

MbbrAccelerations MbbrDynamics::accelerations(const Motion& m, const Mass& mass,
                                              const Loads& loads) const noexcept {
  const Vec3& w = m.omega_B;
  const double ml = p_.m_t * p_.l;
  const Vec3 e1 = m.R().row(0);
  const Vec3 e2 = m.R().row(1);
  const Vec3 ball_rate_B = e1 * m.phi_dot_star.x() + e2 * m.phi_dot_star.y();
  const Vec3 wheel_gyroscopic = p_.I_w * w.cross(ball_rate_B);
  const Vec3 centripetal = ml * Vec3(w.x() * w.z(), w.y() * w.z(), -(w.x() * w.x() + w.y() * w.y()));
  const Vec3 I_t(p_.I_t1, p_.I_t2, p_.I_t3);
  const Vec3 up_B = m.R().row(2);

  const Vec3 on_body = loads.push_B - centripetal;
  const Vec3 on_ball = wheel_gyroscopic + loads.tau_B;
  const Vec3 b_body = -w.cross(I_t.cwiseProduct(w)) + p_.l * Vec3(-on_body.y(), on_body.x(), 0.0) -
                      ml * kGravity_m_s2 * Vec3(-up_B.y(), up_B.x(), 0.0) - on_ball;
  const Vec2 b_ball(-p_.r * (e2.dot(on_body) + loads.pull_star.y()) + e1.dot(on_ball),
                    p_.r * (e1.dot(on_body) + loads.pull_star.x()) + e2.dot(on_ball));
  return solve(mass, b_body, b_ball);
}

MbbrAccelerations MbbrDynamics::response(const Motion& m, const Mass& mass,
                                         const Vec3& tau_B) const noexcept {
  return solve(mass, -tau_B, m.R().template topRows<2>() * tau_B);
}

Vec3 MbbrDynamics::accelerometer_B(const Motion& m, const Accelerations& a,
                                   const Vec3& arm_B) const noexcept {
  const Vec2 ball = ball_velocity(p_.r, a.phi_ddot_inertial);
  const Vec3 gravity_minus_ball(-ball.x(), -ball.y(), -kGravity_m_s2);
  return m.R().transpose() * gravity_minus_ball - a.omega_dot_B.cross(arm_B) -
         m.omega_B.cross(m.omega_B.cross(arm_B));
}

Vec3 MbbrDynamics::theta_ddot(const Motion& m, const Accelerations& a) noexcept {
  const Vec3 rate = m.theta_dot();
  const Vec3& w_dot = a.omega_dot_B;
  const double y = m.cx() * w_dot.y() - m.sx() * w_dot.z() - rate.x() * rate.z() * m.cy();
  const double z =
      (m.sx() * w_dot.y() + m.cx() * w_dot.z() + rate.x() * rate.y() + rate.y() * rate.z() * m.sy()) / m.cy();
  return {w_dot.x() + m.cy() * rate.y() * rate.z() + m.sy() * z, y, z};
}

Vec3 MbbrDynamics::relative_mobility() const noexcept {
  const Motion rest;
  const Mass upright = mass(rest);
  Vec3 mobility;
  for (int axis = 0; axis < 3; ++axis) {
    const Accelerations a = response(rest, upright, Vec3::Unit(axis));
    const Vec3 ball(a.phi_ddot_inertial.x(), a.phi_ddot_inertial.y(), 0.0);
    mobility(axis) = (ball - a.omega_dot_B)(axis);
  }
  return mobility;
}

}  // namespace equipoise
