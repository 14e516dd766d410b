// Exact rolling dynamics of the MBBR (Kane's form): body, ball without spin, wheels through phi_B'.
// In: attitude, body rates, ball rates (yaw frame), total torque on the ball (body axes) -> accelerations.
// Source: derived from first principles; [T] A.2 applies Lagrange to quasi-coordinates and is not used
// (docs/derivation.md). Deterministic, no allocation.
#pragma once

#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

/// Tilt with its sines and cosines, which every function below needs: computed once per evaluation.
class MbbrMotion {
 public:
  MbbrMotion() = default;
  MbbrMotion(const Vec2& theta_xy, const Vec3& omega, const Vec2& phi_dot) noexcept
      : omega_B(omega),
        phi_dot_star(phi_dot),
        theta_xy_(theta_xy),
        sx_(std::sin(theta_xy.x())),
        cx_(std::cos(theta_xy.x())),
        sy_(std::sin(theta_xy.y())),
        cy_(std::cos(theta_xy.y())) {}

  const Vec2& theta_xy() const noexcept { return theta_xy_; }
  double sx() const noexcept { return sx_; }
  double cx() const noexcept { return cx_; }
  double sy() const noexcept { return sy_; }
  double cy() const noexcept { return cy_; }
  /// Euler angle rates, [T] (A.13) inverted.
  Vec3 theta_dot() const noexcept;

  Vec3 omega_B = Vec3::Zero();       // body rates
  Vec2 phi_dot_star = Vec2::Zero();  // ball rates, yaw frame

 private:
  Vec2 theta_xy_ = Vec2::Zero();
  double sx_ = 0.0, cx_ = 1.0, sy_ = 0.0, cy_ = 1.0;
};

struct MbbrAccelerations {
  Vec3 omega_dot_B;
  Vec2 phi_ddot_inertial;  // inertial acceleration of the ball angles, resolved in the yaw frame
};

class MbbrDynamics {
 public:
  explicit MbbrDynamics(const MbbrParameters& p) noexcept;

  /// `tau_B`: torque on the ball; `push_B`: force on the body's centre of mass, N; `pull_star`: force on the
  /// ball's centre, yaw frame, N.
  MbbrAccelerations accelerations(const MbbrMotion& m, const Vec3& tau_B, const Vec3& push_B = Vec3::Zero(),
                                  const Vec2& pull_star = Vec2::Zero()) const noexcept;

  /// Ball rate relative to the body, body axes: what the encoders see. [T] (5.10)
  static Vec3 encoder_rate_B(const MbbrMotion& m) noexcept;

  /// Gravity minus acceleration at the IMU, body axes: the negative of an accelerometer's reading. [T] (5.26)
  Vec3 accelerometer_B(const MbbrMotion& m, const MbbrAccelerations& a) const noexcept;

  /// d(phi*')/dt: the inertial acceleration plus the transport term of the turning frame.
  static Vec2 phi_star_ddot(const MbbrMotion& m, const MbbrAccelerations& a) noexcept;

  /// Second derivatives of the Euler angles.
  static Vec3 theta_ddot(const MbbrMotion& m, const MbbrAccelerations& a) noexcept;

  /// Encoder-rate response to a torque about each body axis, upright: 1/effective inertia.
  Vec3 relative_mobility() const noexcept;

 private:
  MbbrParameters p_;
  Vec3 body_inertia_;  // about the ball's centre, with the wheels
  double ball_inertia_;
};

}  // namespace equipoise
