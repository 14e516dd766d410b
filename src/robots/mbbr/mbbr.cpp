#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

Vec3 body_rates(const Vec2& theta_xy, const Vec3& theta_dot) noexcept {
  const double sx = std::sin(theta_xy.x());
  const double cx = std::cos(theta_xy.x());
  const double sy = std::sin(theta_xy.y());
  const double cy = std::cos(theta_xy.y());
  return {theta_dot.x() - sy * theta_dot.z(), cx * theta_dot.y() + cy * sx * theta_dot.z(),
          -sx * theta_dot.y() + cx * cy * theta_dot.z()};
}

Vec3 euler_rates(const Vec2& theta_xy, const Vec3& omega_B) noexcept {
  const double sx = std::sin(theta_xy.x());
  const double cx = std::cos(theta_xy.x());
  const double z = (sx * omega_B.y() + cx * omega_B.z()) / std::cos(theta_xy.y());
  return {omega_B.x() + std::sin(theta_xy.y()) * z, cx * omega_B.y() - sx * omega_B.z(), z};
}

bool recall(const StateView& logged, MbbrEstimate* truth) noexcept {
  truth->theta_xy = logged.theta_rad.head<2>();
  truth->theta_z = logged.theta_rad.z();
  truth->omega_B = logged.omega_B_rad_s;
  truth->theta_dot = euler_rates(truth->theta_xy, truth->omega_B);
  truth->phi_dot_star = logged.phi_dot_rad_s;
  truth->phi = logged.phi_rad;
  return true;
}

}  // namespace equipoise
