// Exact dynamics of the two-wheel inverted pendulum.
// In: lean, rates, torque inputs -> out: accelerations of (theta, phi, psi) and the accelerometer at the
// body's CoM. Source: [T] (A.1)-(A.4) with its slips corrected, and the side force that keeps the wheels from
// sliding sideways (docs/derivation.md). Deterministic, no allocation.
#pragma once

#include "robots/mip/mip.hpp"

namespace equipoise {

struct MipMotion {
  double theta = 0.0;
  double theta_dot = 0.0;
  double phi_dot = 0.0;
  double psi_dot = 0.0;
};

class MipDynamics {
 public:
  /// `side_force`: false as [T] and the reference vectors, which lose it.
  explicit MipDynamics(const MipParameters& p, bool side_force = true) noexcept
      : p_(p), side_(side_force ? p.m_b * p.l * p.r : 0.0) {}

  /// (theta'', phi'', psi'') under the generalised torques of the two motors: `tau_sum` = tau_1 + tau_2 about
  /// the axle, `tau_difference` = tau_1 - tau_2. Wheel angles: phi +- psi d/(2r). (3.17)-(3.18) `tilt`: of
  /// theta.
  Vec3 accelerations(const MipMotion& m, const Turn& tilt, double tau_sum,
                     double tau_difference) const noexcept;
  Vec3 accelerations(const MipMotion& m, double tau_sum, double tau_difference) const noexcept {
    return accelerations(m, Turn(m.theta), tau_sum, tau_difference);
  }
  /// The same with linear motors, u_1 = u_x + u_z, u_2 = u_x - u_z. (3.16), (3.18)
  Vec3 accelerations_from_inputs(const MipMotion& m, double u_x, double u_z) const noexcept;

  /// About the vertical, of body and wheels; `s`: sine of theta.
  double yaw_inertia(double s) const noexcept;

  /// Gravity minus acceleration at `offset_B` from the body's centre of mass, body axes. (3.26)
  Vec3 accelerometer_B(const MipMotion& m, const Vec3& qdd,
                       const Vec3& offset_B = Vec3::Zero()) const noexcept;

 private:
  MipParameters p_;
  double side_;  // kg m2
};

}  // namespace equipoise
