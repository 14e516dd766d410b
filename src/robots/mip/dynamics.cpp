#include "robots/mip/dynamics.hpp"

#include <Eigen/Geometry>

namespace equipoise {

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
