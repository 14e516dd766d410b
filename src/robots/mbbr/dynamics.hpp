// Exact rolling dynamics of the MBBR (Kane's form): body, ball without spin, wheels through phi_B'.
// In: attitude, body rates, ball rates (yaw frame), total torque on the ball (body axes) -> accelerations.
// Source: derived from first principles; [T] A.2 applies Lagrange to quasi-coordinates and is not used
// (docs/derivation.md). Deterministic, no allocation.
#pragma once

#include <Eigen/Geometry>

#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

/// Tilt with its sines, cosines and rotation, which every function below needs: computed once per evaluation.
class MbbrMotion {
 public:
  MbbrMotion() = default;
  MbbrMotion(const Vec2& theta_xy, const Vec3& omega, const Vec2& phi_dot) noexcept
      : MbbrMotion(theta_xy, Turn(theta_xy.x()), Turn(theta_xy.y()), omega, phi_dot) {}
  /// Within a step of an integrator: the sines follow from those of `before`.
  MbbrMotion(const MbbrMotion& before, const Vec2& theta_xy, const Vec3& omega, const Vec2& phi_dot) noexcept
      : MbbrMotion(theta_xy, before.x_.near(theta_xy.x(), theta_xy.x() - before.theta_xy_.x()),
                   before.y_.near(theta_xy.y(), theta_xy.y() - before.theta_xy_.y()), omega, phi_dot) {}

  const Vec2& theta_xy() const noexcept { return theta_xy_; }
  double sx() const noexcept { return x_.sine(); }
  double cx() const noexcept { return x_.cosine(); }
  double sy() const noexcept { return y_.sine(); }
  double cy() const noexcept { return y_.cosine(); }
  /// Of the tilt alone, yaw frame <- body: Ry(theta_y) Rx(theta_x). Rows: the yaw frame's axes in body
  /// components.
  const Mat3& R() const noexcept { return R_; }
  /// Euler angle rates, [T] (A.13) inverted.
  Vec3 theta_dot() const noexcept {
    const double z = (sx() * omega_B.y() + cx() * omega_B.z()) / cy();
    return {omega_B.x() + sy() * z, cx() * omega_B.y() - sx() * omega_B.z(), z};
  }

  Vec3 omega_B = Vec3::Zero();       // body rates
  Vec2 phi_dot_star = Vec2::Zero();  // ball rates, yaw frame
  double spin_rad_s = 0.0;           // ball about the vertical; only where it slips on the floor

 private:
  MbbrMotion(const Vec2& theta_xy, const Turn& x, const Turn& y, const Vec3& omega,
             const Vec2& phi_dot) noexcept
      : omega_B(omega), phi_dot_star(phi_dot), theta_xy_(theta_xy), x_(x), y_(y) {
    R_.row(0) << cy(), sy() * sx(), sy() * cx();
    R_.row(1) << 0.0, cx(), -sx();
    R_.row(2) << -sy(), cy() * sx(), cy() * cx();
  }

  Vec2 theta_xy_ = Vec2::Zero();
  Turn x_{0.0}, y_{0.0};  // of the tilt
  Mat3 R_ = Mat3::Identity();
};

/// Forces beside gravity. `tau_B`: torque on the ball; `push_B`: on the body's centre of mass, N;
/// `pull_star`: on the ball's centre, yaw frame, N.
struct MbbrLoads {
  Vec3 tau_B = Vec3::Zero();
  Vec3 push_B = Vec3::Zero();
  Vec2 pull_star = Vec2::Zero();
};

struct MbbrAccelerations {
  Vec3 omega_dot_B;
  Vec2 phi_ddot_inertial;  // inertial acceleration of the ball angles, resolved in the yaw frame
};

/// Kane's mass matrix at one tilt, factored.
struct MbbrMass {
  Mat<3, 2> C;   // body to ball
  Mat<3, 2> DC;  // diag(body_inertia)^-1 C
  double s11 = 0.0, s22 = 0.0, s12 = 0.0, det = 1.0;
};

class MbbrDynamics {
 public:
  using Motion = MbbrMotion;
  using Loads = MbbrLoads;
  using Accelerations = MbbrAccelerations;
  using Mass = MbbrMass;

  explicit MbbrDynamics(const MbbrParameters& p) noexcept;

  Accelerations accelerations(const Motion& m, const Mass& mass, const Loads& loads) const noexcept;
  Accelerations accelerations(const Motion& m, const Vec3& tau_B, const Vec3& push_B = Vec3::Zero(),
                              const Vec2& pull_star = Vec2::Zero()) const noexcept {
    return accelerations(m, mass(m), {tau_B, push_B, pull_star});
  }
  Mass mass(const Motion& m) const noexcept;
  /// What a further torque on the ball adds: the accelerations are linear in it.
  Accelerations response(const Motion& m, const Mass& mass, const Vec3& tau_B) const noexcept;

  /// Ball rate relative to the body, body axes: what the encoders see. [T] (5.10)
  static Vec3 encoder_rate_B(const Motion& m) noexcept {
    return m.R().transpose().lazyProduct(Vec3(m.phi_dot_star.x(), m.phi_dot_star.y(), m.spin_rad_s)) -
           m.omega_B;
  }

  /// Gravity minus acceleration at the IMU, body axes: the negative of an accelerometer's reading. [T] (5.26)
  Vec3 accelerometer_B(const Motion& m, const Accelerations& a) const noexcept {
    return accelerometer_B(m, a, p_.l_a);
  }
  /// The same at another place of the body.
  Vec3 accelerometer_B(const Motion& m, const Accelerations& a, const Vec3& arm_B) const noexcept;

  /// d(phi*')/dt: the inertial acceleration plus the transport term of the frame that turns at `yaw_rate`.
  static Vec2 phi_star_ddot(const Motion& m, const Accelerations& a, double yaw_rate_rad_s) noexcept {
    return a.phi_ddot_inertial + yaw_rate_rad_s * Vec2(m.phi_dot_star.y(), -m.phi_dot_star.x());
  }
  static Vec2 phi_star_ddot(const Motion& m, const Accelerations& a) noexcept {
    return phi_star_ddot(m, a, m.theta_dot().z());
  }

  /// Second derivatives of the Euler angles.
  static Vec3 theta_ddot(const Motion& m, const Accelerations& a) noexcept;

  /// Encoder-rate response to a torque about each body axis, upright: 1/effective inertia.
  Vec3 relative_mobility() const noexcept;

 private:
  Accelerations solve(const Mass& mass, const Vec3& b_body, const Vec2& b_ball) const noexcept;

  MbbrParameters p_;
  Vec3 inverse_body_inertia_;  // about the ball's centre, with the wheels
  double ball_inertia_;
};

}  // namespace equipoise
