#include "robots/mip/dynamics.hpp"

#include <Eigen/Geometry>

namespace equipoise {

Vec3 MipDynamics::accelerations(const MipMotion& m, const Turn& tilt, double tau_sum,
                                double tau_difference) const noexcept {
  const double s = tilt.sine();
  const double c = tilt.cosine();
  const double lm = p_.l * p_.m_b;
  const double wheels = 2.0 * p_.I_w1 + (p_.m_b + 2.0 * p_.m_w) * p_.r * p_.r;
  const double C = p_.I_b2 - p_.I_b3 + 2.0 * (p_.I_w2 - p_.I_w3) + p_.l * lm;

  const double m11 = p_.I_b1 + p_.l * lm + 2.0 * lm * p_.r * c + wheels;
  const double m12 = wheels + lm * p_.r * c;
  const double m22 = wheels + 2.0 * p_.I_r;
  const double m33 = yaw_inertia(s);

  const double side = side_ * s * m.psi_dot;

  const double b1 =
      s * (C * c * m.psi_dot * m.psi_dot + lm * (kGravity_m_s2 + p_.r * m.theta_dot * m.theta_dot)) +
      side * m.psi_dot;
  const double b2 = tau_sum + lm * p_.r * s * m.theta_dot * m.theta_dot + side * m.psi_dot;
  const double b3 = 0.5 * p_.d / p_.r * tau_difference - C * 2.0 * s * c * m.psi_dot * m.theta_dot -
                    side * (m.phi_dot + m.theta_dot);

  const double det = m11 * m22 - m12 * m12;
  return {(m22 * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det, b3 / m33};
}

double MipDynamics::yaw_inertia(double s) const noexcept {
  const double C = p_.I_b2 - p_.I_b3 + 2.0 * (p_.I_w2 - p_.I_w3) + p_.l * (p_.l * p_.m_b);
  return p_.I_b3 + 2.0 * p_.I_w3 + C * s * s +
         0.5 * p_.d * p_.d * ((p_.I_w1 + p_.I_r) / (p_.r * p_.r) + p_.m_w);
}

Vec3 MipDynamics::accelerations_from_inputs(const MipMotion& m, double u_x, double u_z) const noexcept {
  return accelerations(m, 2.0 * (p_.k1 * u_x - p_.k2 * m.phi_dot),
                       2.0 * p_.k1 * u_z - p_.k2 * p_.d / p_.r * m.psi_dot);
}

Vec3 MipDynamics::accelerometer_B(const MipMotion& m, const Vec3& qdd, const Vec3& offset_B) const noexcept {
  const double s = std::sin(m.theta);
  const double c = std::cos(m.theta);
  // Axle, resolved in the yaw frame; rolling: v_y = -r (phi' + theta').
  const Vec3 axle(m.psi_dot * p_.r * (m.phi_dot + m.theta_dot), -p_.r * (qdd(1) + qdd(0)), 0.0);
  const Vec3 gravity_minus_axle = Vec3(0.0, 0.0, -kGravity_m_s2) - axle;
  const Vec3 in_body(gravity_minus_axle.x(), c * gravity_minus_axle.y() + s * gravity_minus_axle.z(),
                     -s * gravity_minus_axle.y() + c * gravity_minus_axle.z());
  const Vec3 omega(m.theta_dot, s * m.psi_dot, c * m.psi_dot);
  const Vec3 omega_dot(qdd(0), s * qdd(2) + c * m.theta_dot * m.psi_dot,
                       c * qdd(2) - s * m.theta_dot * m.psi_dot);
  const Vec3 arm = Vec3(0.0, 0.0, p_.l) + offset_B;
  return in_body - omega_dot.cross(arm) - omega.cross(omega.cross(arm));
}

}  // namespace equipoise
