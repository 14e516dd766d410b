// Exact rolling dynamics of the MBBR (Kane's form): body, ball without spin, wheels through phi_B'.
// In: attitude, body rates, ball rates (yaw frame), total torque on the ball (body axes) -> accelerations.
// Source: derived from first principles; [T] A.2 applies Lagrange to quasi-coordinates and is not used
// (docs/derivation.md). Deterministic, no allocation.
#pragma once

#include <Eigen/Geometry>

#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

/// Tilt with its sines, cosines and rotation, which every function below needs: computed once per evaluation.
template <class Real>
class MbbrMotionOf {
 public:
  using V2 = VecOf<Real, 2>;
  using V3 = VecOf<Real, 3>;

  MbbrMotionOf() = default;
  MbbrMotionOf(const V2& theta_xy, const V3& omega, const V2& phi_dot) noexcept
      : MbbrMotionOf(theta_xy, TurnOf<Real>(theta_xy.x()), TurnOf<Real>(theta_xy.y()), omega, phi_dot) {}
  /// Within a step of an integrator: the sines follow from those of `before`.
  MbbrMotionOf(const MbbrMotionOf& before, const V2& theta_xy, const V3& omega, const V2& phi_dot) noexcept
      : MbbrMotionOf(theta_xy, before.x_.near(theta_xy.x(), theta_xy.x() - before.theta_xy_.x()),
                     before.y_.near(theta_xy.y(), theta_xy.y() - before.theta_xy_.y()), omega, phi_dot) {}

  const V2& theta_xy() const noexcept { return theta_xy_; }
  const Real& sx() const noexcept { return x_.sine(); }
  const Real& cx() const noexcept { return x_.cosine(); }
  const Real& sy() const noexcept { return y_.sine(); }
  const Real& cy() const noexcept { return y_.cosine(); }
  /// Of the tilt alone, yaw frame <- body: Ry(theta_y) Rx(theta_x). Rows: the yaw frame's axes in body
  /// components.
  const MatOf<Real, 3, 3>& R() const noexcept { return R_; }
  /// Euler angle rates, [T] (A.13) inverted.
  V3 theta_dot() const noexcept;

  V3 omega_B = V3::Zero();       // body rates
  V2 phi_dot_star = V2::Zero();  // ball rates, yaw frame
  Real spin_rad_s{0.0};          // ball about the vertical; only where it slips on the floor

 private:
  MbbrMotionOf(const V2& theta_xy, const TurnOf<Real>& x, const TurnOf<Real>& y, const V3& omega,
               const V2& phi_dot) noexcept;

  V2 theta_xy_ = V2::Zero();
  TurnOf<Real> x_{Real(0.0)}, y_{Real(0.0)};  // of the tilt
  MatOf<Real, 3, 3> R_ = MatOf<Real, 3, 3>::Identity();
};
using MbbrMotion = MbbrMotionOf<double>;

/// Forces beside gravity. `tau_B`: torque on the ball; `push_B`: on the body's centre of mass, N;
/// `pull_star`: on the ball's centre, yaw frame, N.
template <class Real>
struct MbbrLoadsOf {
  VecOf<Real, 3> tau_B = VecOf<Real, 3>::Zero();
  VecOf<Real, 3> push_B = VecOf<Real, 3>::Zero();
  VecOf<Real, 2> pull_star = VecOf<Real, 2>::Zero();
};
using MbbrLoads = MbbrLoadsOf<double>;

template <class Real>
struct MbbrAccelerationsOf {
  VecOf<Real, 3> omega_dot_B;
  VecOf<Real, 2> phi_ddot_inertial;  // inertial acceleration of the ball angles, resolved in the yaw frame
};
using MbbrAccelerations = MbbrAccelerationsOf<double>;

/// Kane's mass matrix at one tilt, factored.
template <class Real>
struct MbbrMassOf {
  MatOf<Real, 3, 2> C;   // body to ball
  MatOf<Real, 3, 2> DC;  // diag(body_inertia)^-1 C
  Real s11{0.0}, s22{0.0}, s12{0.0}, det{1.0};
};
using MbbrMass = MbbrMassOf<double>;

/// What the dynamics need of a robot; names and units: MbbrParameters.
template <class Real>
struct MbbrBodiesOf {
  Real m_t, m_b, r, l, I_t1, I_t2, I_t3, I_b, I_w;
  Real l_a[3];
};
using MbbrBodies = MbbrBodiesOf<double>;
MbbrBodies bodies(const MbbrParameters& p) noexcept;

template <class Real>
class MbbrDynamicsOf {
 public:
  using V2 = VecOf<Real, 2>;
  using V3 = VecOf<Real, 3>;
  using Motion = MbbrMotionOf<Real>;
  using Loads = MbbrLoadsOf<Real>;
  using Accelerations = MbbrAccelerationsOf<Real>;
  using Mass = MbbrMassOf<Real>;

  explicit MbbrDynamicsOf(const MbbrParameters& p) noexcept : MbbrDynamicsOf(bodies(p)) {}
  explicit MbbrDynamicsOf(const MbbrBodiesOf<Real>& p) noexcept;

  Accelerations accelerations(const Motion& m, const Mass& mass, const Loads& loads) const noexcept;
  Accelerations accelerations(const Motion& m, const V3& tau_B, const V3& push_B = V3::Zero(),
                              const V2& pull_star = V2::Zero()) const noexcept {
    return accelerations(m, mass(m), {tau_B, push_B, pull_star});
  }
  Mass mass(const Motion& m) const noexcept;
  /// What a further torque on the ball adds: the accelerations are linear in it.
  Accelerations response(const Motion& m, const Mass& mass, const V3& tau_B) const noexcept;

  /// Ball rate relative to the body, body axes: what the encoders see. [T] (5.10)
  static V3 encoder_rate_B(const Motion& m) noexcept {
    return m.R().transpose().lazyProduct(V3(m.phi_dot_star.x(), m.phi_dot_star.y(), m.spin_rad_s)) -
           m.omega_B;
  }

  /// Gravity minus acceleration at the IMU, body axes: the negative of an accelerometer's reading. [T] (5.26)
  V3 accelerometer_B(const Motion& m, const Accelerations& a) const noexcept {
    return accelerometer_B(m, a, V3(p_.l_a[0], p_.l_a[1], p_.l_a[2]));
  }
  /// The same at another place of the body.
  V3 accelerometer_B(const Motion& m, const Accelerations& a, const V3& arm_B) const noexcept;

  /// d(phi*')/dt: the inertial acceleration plus the transport term of the frame that turns at `yaw_rate`.
  static V2 phi_star_ddot(const Motion& m, const Accelerations& a, const Real& yaw_rate_rad_s) noexcept {
    return a.phi_ddot_inertial + yaw_rate_rad_s * V2(m.phi_dot_star.y(), -m.phi_dot_star.x());
  }
  static V2 phi_star_ddot(const Motion& m, const Accelerations& a) noexcept {
    return phi_star_ddot(m, a, m.theta_dot().z());
  }

  /// Second derivatives of the Euler angles.
  static V3 theta_ddot(const Motion& m, const Accelerations& a) noexcept;

  /// Encoder-rate response to a torque about each body axis, upright: 1/effective inertia.
  V3 relative_mobility() const noexcept;

 private:
  Accelerations solve(const Mass& mass, const V3& b_body, const V2& b_ball) const noexcept;

  MbbrBodiesOf<Real> p_;
  V3 inverse_body_inertia_;  // about the ball's centre, with the wheels
  Real ball_inertia_;
};
using MbbrDynamics = MbbrDynamicsOf<double>;

template <class Real>
MbbrMotionOf<Real>::MbbrMotionOf(const V2& theta_xy, const TurnOf<Real>& x, const TurnOf<Real>& y,
                                 const V3& omega, const V2& phi_dot) noexcept
    : omega_B(omega), phi_dot_star(phi_dot), theta_xy_(theta_xy), x_(x), y_(y) {
  R_.row(0) << cy(), sy() * sx(), sy() * cx();
  R_.row(1) << Real(0.0), cx(), -sx();
  R_.row(2) << -sy(), cy() * sx(), cy() * cx();
}

template <class Real>
VecOf<Real, 3> MbbrMotionOf<Real>::theta_dot() const noexcept {
  const Real z = (sx() * omega_B.y() + cx() * omega_B.z()) / cy();
  return {omega_B.x() + sy() * z, cx() * omega_B.y() - sx() * omega_B.z(), z};
}

template <class Real>
MbbrDynamicsOf<Real>::MbbrDynamicsOf(const MbbrBodiesOf<Real>& p) noexcept
    : p_(p),
      inverse_body_inertia_(
          V3(p.I_t1 + p.m_t * p.l * p.l + p.I_w, p.I_t2 + p.m_t * p.l * p.l + p.I_w, p.I_t3 + p.I_w)
              .cwiseInverse()),
      ball_inertia_(p.I_b + p.I_w + (p.m_b + p.m_t) * p.r * p.r) {}

// With c = (0, 0, l), alpha the ball's inertial angular acceleration (two components, yaw frame), S the map
// phi' -> ball velocity / r, P = [e1 e2] and C = m_t [c]x R^T r S - I_w R^T P, Kane's equations are
//   diag(body_inertia) Omega' + C alpha = b_body,   C^T Omega' + ball_inertia alpha = b_ball.
template <class Real>
MbbrMassOf<Real> MbbrDynamicsOf<Real>::mass(const Motion& m) const noexcept {
  const auto& R = m.R();
  const Real mlr = p_.m_t * p_.l * p_.r;  // [c]x v = l (-v_y, v_x, 0); S maps phi_x' to -e2 and phi_y' to e1
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

template <class Real>
MbbrAccelerationsOf<Real> MbbrDynamicsOf<Real>::solve(const Mass& mass, const V3& b_body,
                                                      const V2& b_ball) const noexcept {
  const V2 rhs = b_ball - mass.DC.transpose() * b_body;
  Accelerations a;
  a.phi_ddot_inertial =
      V2(mass.s22 * rhs.x() - mass.s12 * rhs.y(), mass.s11 * rhs.y() - mass.s12 * rhs.x()) / mass.det;
  a.omega_dot_B = inverse_body_inertia_.cwiseProduct(b_body - mass.C * a.phi_ddot_inertial);
  return a;
}

template <class Real>
MbbrAccelerationsOf<Real> MbbrDynamicsOf<Real>::accelerations(const Motion& m, const Mass& mass,
                                                              const Loads& loads) const noexcept {
  const V3& w = m.omega_B;
  const Real ml = p_.m_t * p_.l;
  const V3 e1 = m.R().row(0);
  const V3 e2 = m.R().row(1);
  const V3 ball_rate_B = e1 * m.phi_dot_star.x() + e2 * m.phi_dot_star.y();
  const V3 wheel_gyroscopic = p_.I_w * w.cross(ball_rate_B);
  const V3 centripetal = ml * V3(w.x() * w.z(), w.y() * w.z(), -(w.x() * w.x() + w.y() * w.y()));
  const V3 I_t(p_.I_t1, p_.I_t2, p_.I_t3);
  const V3 up_B = m.R().row(2);

  const V3 on_body = loads.push_B - centripetal;
  const V3 on_ball = wheel_gyroscopic + loads.tau_B;
  const V3 b_body = -w.cross(I_t.cwiseProduct(w)) + p_.l * V3(-on_body.y(), on_body.x(), 0.0) -
                    ml * kGravity_m_s2 * V3(-up_B.y(), up_B.x(), 0.0) - on_ball;
  const V2 b_ball(-p_.r * (e2.dot(on_body) + loads.pull_star.y()) + e1.dot(on_ball),
                  p_.r * (e1.dot(on_body) + loads.pull_star.x()) + e2.dot(on_ball));
  return solve(mass, b_body, b_ball);
}

template <class Real>
MbbrAccelerationsOf<Real> MbbrDynamicsOf<Real>::response(const Motion& m, const Mass& mass,
                                                         const V3& tau_B) const noexcept {
  return solve(mass, -tau_B, m.R().template topRows<2>() * tau_B);
}

template <class Real>
VecOf<Real, 3> MbbrDynamicsOf<Real>::accelerometer_B(const Motion& m, const Accelerations& a,
                                                     const V3& arm_B) const noexcept {
  const V2 ball = ball_velocity(p_.r, a.phi_ddot_inertial);
  const V3 gravity_minus_ball(-ball.x(), -ball.y(), -kGravity_m_s2);
  return m.R().transpose() * gravity_minus_ball - a.omega_dot_B.cross(arm_B) -
         m.omega_B.cross(m.omega_B.cross(arm_B));
}

template <class Real>
VecOf<Real, 3> MbbrDynamicsOf<Real>::theta_ddot(const Motion& m, const Accelerations& a) noexcept {
  const V3 rate = m.theta_dot();
  const V3& w_dot = a.omega_dot_B;
  const Real y = m.cx() * w_dot.y() - m.sx() * w_dot.z() - rate.x() * rate.z() * m.cy();
  const Real z =
      (m.sx() * w_dot.y() + m.cx() * w_dot.z() + rate.x() * rate.y() + rate.y() * rate.z() * m.sy()) / m.cy();
  return {w_dot.x() + m.cy() * rate.y() * rate.z() + m.sy() * z, y, z};
}

template <class Real>
VecOf<Real, 3> MbbrDynamicsOf<Real>::relative_mobility() const noexcept {
  const Motion rest;
  const Mass upright = mass(rest);
  V3 mobility;
  for (int axis = 0; axis < 3; ++axis) {
    const Accelerations a = response(rest, upright, V3::Unit(axis));
    const V3 ball(a.phi_ddot_inertial.x(), a.phi_ddot_inertial.y(), 0.0);
    mobility(axis) = (ball - a.omega_dot_B)(axis);
  }
  return mobility;
}

}  // namespace equipoise
