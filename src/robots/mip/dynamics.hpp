// Exact dynamics of the two-wheel inverted pendulum.
// In: lean, rates, torque inputs -> out: accelerations of (theta, phi, psi) and the accelerometer at the
// body's CoM. Source: [T] (A.1)-(A.4) with its slips corrected (docs/derivation.md). Deterministic, no
// allocation.
#pragma once

#include "robots/mip/mip.hpp"

namespace equipoise {

template <class Real>
struct MipMotionOf {
  Real theta{0.0};
  Real theta_dot{0.0};
  Real phi_dot{0.0};
  Real psi_dot{0.0};
};
using MipMotion = MipMotionOf<double>;

/// What the dynamics need of a robot; names and units: MipParameters.
template <class Real>
struct MipBodiesOf {
  Real m_b, m_w, r, d, l, I_b1, I_b2, I_b3, I_w1, I_w2, I_w3, I_r;
};
using MipBodies = MipBodiesOf<double>;
inline MipBodies bodies(const MipParameters& p) noexcept {
  return {p.m_b, p.m_w, p.r, p.d, p.l, p.I_b1, p.I_b2, p.I_b3, p.I_w1, p.I_w2, p.I_w3, p.I_r};
}

template <class Real>
class MipDynamicsOf {
 public:
  explicit MipDynamicsOf(const MipBodiesOf<Real>& p) noexcept : p_(p) {}

  /// (theta'', phi'', psi'') under the generalised torques of the two motors: `tau_sum` = tau_1 + tau_2 about
  /// the axle, `tau_difference` = tau_1 - tau_2. Wheel angles: phi +- psi d/(2r). (3.17)-(3.18) `tilt`: of
  /// theta.
  VecOf<Real, 3> accelerations(const MipMotionOf<Real>& m, const TurnOf<Real>& tilt, const Real& tau_sum,
                               const Real& tau_difference) const noexcept;
  /// About the vertical, of body and wheels; `s`: sine of theta.
  Real yaw_inertia(const Real& s) const noexcept {
    const Real C = p_.I_b2 - p_.I_b3 + 2.0 * (p_.I_w2 - p_.I_w3) + p_.l * (p_.l * p_.m_b);
    return p_.I_b3 + 2.0 * p_.I_w3 + C * s * s +
           0.5 * p_.d * p_.d * ((p_.I_w1 + p_.I_r) / (p_.r * p_.r) + p_.m_w);
  }
  const Real& wheel_radius_m() const noexcept { return p_.r; }

 private:
  MipBodiesOf<Real> p_;
};

template <class Real>
VecOf<Real, 3> MipDynamicsOf<Real>::accelerations(const MipMotionOf<Real>& m, const TurnOf<Real>& tilt,
                                                  const Real& tau_sum,
                                                  const Real& tau_difference) const noexcept {
  const Real s = tilt.sine();
  const Real c = tilt.cosine();
  const Real lm = p_.l * p_.m_b;
  const Real wheels = 2.0 * p_.I_w1 + (p_.m_b + 2.0 * p_.m_w) * p_.r * p_.r;
  const Real C = p_.I_b2 - p_.I_b3 + 2.0 * (p_.I_w2 - p_.I_w3) + p_.l * lm;

  const Real m11 = p_.I_b1 + p_.l * lm + 2.0 * lm * p_.r * c + wheels;
  const Real m12 = wheels + lm * p_.r * c;
  const Real m22 = wheels + 2.0 * p_.I_r;
  const Real m33 = yaw_inertia(s);

  const Real b1 =
      s * (C * c * m.psi_dot * m.psi_dot + lm * (kGravity_m_s2 + p_.r * m.theta_dot * m.theta_dot));
  const Real b2 = tau_sum + lm * p_.r * s * m.theta_dot * m.theta_dot;
  const Real b3 = 0.5 * p_.d / p_.r * tau_difference - C * 2.0 * s * c * m.psi_dot * m.theta_dot;

  const Real det = m11 * m22 - m12 * m12;
  return {(m22 * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det, b3 / m33};
}

/// With the robot's motors and sensors.
class MipDynamics : public MipDynamicsOf<double> {
 public:
  explicit MipDynamics(const MipParameters& p) noexcept : MipDynamicsOf<double>(bodies(p)), p_(p) {}

  using MipDynamicsOf<double>::accelerations;
  Vec3 accelerations(const MipMotion& m, double tau_sum, double tau_difference) const noexcept {
    return accelerations(m, Turn(m.theta), tau_sum, tau_difference);
  }

  /// The same with linear motors, u_1 = u_x + u_z, u_2 = u_x - u_z. (3.16), (3.18)
  Vec3 accelerations_from_inputs(const MipMotion& m, double u_x, double u_z) const noexcept;

  /// Gravity minus acceleration at `offset_B` from the body's centre of mass, body axes. (3.26)
  Vec3 accelerometer_B(const MipMotion& m, const Vec3& qdd,
                       const Vec3& offset_B = Vec3::Zero()) const noexcept;

 private:
  MipParameters p_;
};

}  // namespace equipoise
