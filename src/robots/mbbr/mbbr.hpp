// The ball-balancing robot: dimensions, inertias, wheel and torque maps.
// Source: [T] Tables 5.2, 5.3.1; values come from config/mbbr.toml.
// RT-safe after construction.
#pragma once

#include <optional>

#include "equipoise/control/allocate.hpp"
#include "equipoise/samples.hpp"
#include "equipoise/types.hpp"
#include "robots/mbbr/omniwheels.hpp"

namespace equipoise {

/// Physical parameters, SI. Defaults: [T] Table 5.2.
struct MbbrParameters {
  double m_t = 0.550;     // top body mass
  double m_b = 0.150;     // ball mass
  double r = 0.032;       // ball radius
  double r_w = 0.0125;    // omniwheel radius
  double l = 0.100;       // ball centre to body centre of mass
  double I_t1 = 2.42e-3;  // body inertia about its centre of mass, body axes
  double I_t2 = 2.42e-3;
  double I_t3 = 0.79e-3;
  double I_b = 8.46e-5;       // ball inertia
  double I_w = 1.20e-5;       // three wheels, as seen about the ball (physics: the printed value already is)
  double k1 = 0.176;          // torque per unit of u about the ball's axes, nominal battery
  double k2_ball = 0.011;     // back-EMF about the ball, k2 (r/r_w)^2
  double mu_c = 0.05265;      // Coulomb friction about each body axis, [T] section 5.3
  double mu_v = 0.001056;     // viscous friction
  Vec3 l_a{0.0, 0.0, 0.130};  // ball centre to IMU, body axes
  double alpha_deg = 60.0;    // wheel latitude from the north pole
  double azimuth_deg = -140.0;
  std::optional<double> wheel_tilt_deg;  // beta, about the contact's normal; none: orthogonal wheels

  Mat3 wheel_axes() const noexcept {
    const double alpha = alpha_deg * kPi / 180.0;
    const double beta = wheel_tilt_deg ? *wheel_tilt_deg * kPi / 180.0 : orthogonal_beta_rad(alpha);
    return equipoise::wheel_axes(alpha, beta, azimuth_deg * kPi / 180.0);
  }
};

/// Maps between the three wheels and the body axes, [T] (5.2)-(5.4), (5.14).
class MbbrKinematics {
 public:
  explicit MbbrKinematics(const MbbrParameters& p)
      : ratio_(p.r / p.r_w),
        T_ob_(p.wheel_axes()),
        T_ob_inverse_(p.wheel_tilt_deg ? Mat3(T_ob_.inverse()) : Mat3(T_ob_.transpose())) {}

  /// Ball angle (or rate) relative to the body, body axes, from wheel angles (or rates). (5.3)
  Vec3 ball_from_wheels(const Vec3& wheels) const noexcept {
    return (1.0 / ratio_) * (T_ob_inverse_.transpose() * wheels);
  }
  Vec3 wheels_from_ball(const Vec3& ball_B) const noexcept { return ratio_ * (T_ob_.transpose() * ball_B); }
  /// Rates while the robot turns on a ball that does not.
  Vec3 wheels_of_turn(double yaw_rate_rad_s) const noexcept {
    return wheels_from_ball(Vec3(0.0, 0.0, -yaw_rate_rad_s));
  }
  /// Friction acts about the body axes, [T] section 5.3.
  template <class Compensation>
  Vec3 friction_input(const Compensation& c, const Vec3& wheel_rates) const noexcept {
    return c.compensate(ball_from_wheels(wheel_rates));
  }
  /// Torque on the ball (or input u), body axes, from wheel torques (or duties). (5.4), (5.14)
  Vec3 axes_from_wheels(const Vec3& wheels) const noexcept { return ratio_ * (T_ob_ * wheels); }
  Vec3 wheels_from_axes(const Vec3& axes_B) const noexcept {
    return (1.0 / ratio_) * (T_ob_inverse_ * axes_B);
  }

  /// Wheels within +-limit: balance, in the plane, before yaw.
  Vec3 allocate(const Vec3& axes_B, double limit) const noexcept {
    const Vec3 plane = wheels_from_axes(Vec3(axes_B.x(), axes_B.y(), 0.0));
    const Vec3 yaw = wheels_from_axes(Vec3(0.0, 0.0, axes_B.z()));
    return within(plane, yaw, limit);
  }

  const Mat3& T_ob() const noexcept { return T_ob_; }

 private:
  double ratio_;  // r / r_w
  Mat3 T_ob_;
  Mat3 T_ob_inverse_;
};

/// What the estimators know, and what the simulation's truth is.
struct MbbrEstimate {
  Vec2 theta_xy = Vec2::Zero();      // roll, pitch
  double theta_z = 0.0;              // heading, continuous
  Vec3 theta_dot = Vec3::Zero();     // Euler angle rates
  Vec3 omega_B = Vec3::Zero();       // body rates
  Vec2 phi_dot_star = Vec2::Zero();  // ball rates, yaw frame
  Vec2 phi = Vec2::Zero();           // ball angles, inertial, [T] (6.3)-(6.4)
  double normalized_innovation = 0.0;
};

/// Ball rates (yaw frame) -> velocity of the ball's centre in the same frame, [T] (5.9).
inline Vec2 ball_velocity(double r, const Vec2& phi_dot) noexcept {
  return {r * phi_dot.y(), -r * phi_dot.x()};
}
inline Vec2 ball_rate(double r, const Vec2& velocity) noexcept {
  return {-velocity.y() / r, velocity.x() / r};
}

/// Body rates from Euler angles and their rates, [T] (A.13), and back.
Vec3 body_rates(const Vec2& theta_xy, const Vec3& theta_dot) noexcept;
inline Vec3 body_rates(const MbbrEstimate& x) noexcept { return x.omega_B; }
Vec3 euler_rates(const Vec2& theta_xy, const Vec3& omega_B) noexcept;

struct Mbbr {
  static constexpr int kWheels = 3;
  static constexpr int kInputs = 3;  // u_x, u_y, u_z
  using Parameters = MbbrParameters;
  using Kinematics = MbbrKinematics;
  using Estimate = MbbrEstimate;
  using Sample = Measurement<kWheels>;
};

/// Robot-neutral view.
inline StateView view(const MbbrEstimate& x, const MbbrParameters& p) noexcept {
  StateView v;
  v.theta_rad << x.theta_xy, x.theta_z;
  v.omega_B_rad_s = x.omega_B;
  v.phi_rad = x.phi;
  v.phi_dot_rad_s = x.phi_dot_star;
  v.position_W_m = ball_velocity(p.r, x.phi);
  v.normalized_innovation = x.normalized_innovation;
  return v;
}

/// What the simulation knew, from the view that a log holds.
bool recall(const StateView& logged, MbbrEstimate* truth) noexcept;

/// Attitude: roll and pitch. Speed: inertial velocity of the ball, m/s, [T] section 6.4.
inline StateErrors errors(const StateView& x, const StateView& truth, const MbbrParameters& p) noexcept {
  const Vec2 v = rotate(x.theta_rad.z(), x.phi_dot_rad_s) - rotate(truth.theta_rad.z(), truth.phi_dot_rad_s);
  return {(x.theta_rad - truth.theta_rad).head<2>().squaredNorm(), p.r * p.r * v.squaredNorm(), 2};
}

}  // namespace equipoise
