// The two-wheel inverted pendulum (eduMIP): dimensions, inertias, wheel maps.
// Source: [T] Table 3.2; values come from config/edumip.toml.
// Frames: body x left, y back, z up; theta about x, psi about z; phi is the mean encoder angle (wheel to
// body). RT-safe.
#pragma once

#include "equipoise/control/allocate.hpp"
#include "equipoise/samples.hpp"
#include "equipoise/types.hpp"

namespace equipoise {

/// Physical parameters, SI. Defaults: [T] Table 3.2.
struct MipParameters {
  double m_b = 0.218;     // body mass
  double m_w = 0.024;     // one wheel
  double r = 0.035;       // wheel radius
  double d = 0.070;       // distance between the wheels
  double l = 0.046;       // axle to body centre of mass
  double I_b1 = 5.91e-4;  // body inertia about its centre of mass
  double I_b2 = 2.99e-4;
  double I_b3 = 2.91e-4;
  double I_w1 = 6.42e-5;  // one wheel, about its axle
  double I_w2 = 7.48e-6;
  double I_w3 = 7.48e-6;
  double I_r = 0.0;           // rotor of one motor through its gear, about the wheel's angle against the body
  double k1 = 0.12;           // torque per unit of u, one motor
  double k2 = 0.003;          // back-EMF, one motor
  double mu_c = 0.0;          // Coulomb friction, one wheel
  double mu_v = 0.0;          // viscous friction, one wheel
  Vec3 l_a{0.0, 0.0, 0.046};  // IMU, from the middle of the axle, body axes
  double yaw_to_wheel() const noexcept { return d / (2.0 * r); }  // wheel angle per yaw angle, (3.18)
};

/// Wheels: right, left. Axes: u_x drives both, u_z turns left: u_1 = u_x + u_z, u_2 = u_x - u_z. [T] (3.16)
class MipKinematics {
 public:
  using Input = Vec2;
  using Wheels = Vec2;
  explicit MipKinematics(const MipParameters& p) noexcept : yaw_to_wheel_(p.yaw_to_wheel()) {}

  Wheels wheels_from_axes(const Input& u) const noexcept { return {u.x() + u.y(), u.x() - u.y()}; }
  Input axes_from_wheels(const Wheels& w) const noexcept {
    return {0.5 * (w.x() + w.y()), 0.5 * (w.x() - w.y())};
  }

  /// Wheels within +-limit: balance before yaw.
  Wheels allocate(const Input& u, double limit) const noexcept {
    return within<2>({u.x(), u.x()}, {u.y(), -u.y()}, limit);
  }

  /// Each gear has its own friction.
  template <class Compensation>
  Input friction_input(const Compensation& c, const Wheels& rates) const noexcept {
    return axes_from_wheels(c.compensate(rates));
  }

  /// Mean encoder angle and yaw, or their rates, from the wheels' encoders. (3.18)
  double phi(const Wheels& w) const noexcept { return 0.5 * (w.x() + w.y()); }
  double psi(const Wheels& w) const noexcept { return 0.5 * (w.x() - w.y()) / yaw_to_wheel_; }
  Wheels wheels(double phi, double psi) const noexcept {
    return {phi + yaw_to_wheel_ * psi, phi - yaw_to_wheel_ * psi};
  }
  /// Their rates while the robot turns on the spot.
  Wheels wheels_of_turn(double yaw_rate_rad_s) const noexcept { return wheels(0.0, yaw_rate_rad_s); }

 private:
  double yaw_to_wheel_;
};

/// What the estimators know, and what the simulation's truth is.
struct MipEstimate {
  double theta = 0.0;  // lean
  double phi = 0.0;    // mean encoder angle
  double psi = 0.0;    // heading, continuous
  double theta_dot = 0.0;
  double phi_dot = 0.0;
  double psi_dot = 0.0;
  Vec2 position_W_m = Vec2::Zero();  // middle of the axle, dead reckoning
  double normalized_innovation = 0.0;
};

/// Speed of the axle towards the back, body y in the yaw frame. [T] (3.9)
inline double axle_speed(const MipParameters& p, const MipEstimate& x) noexcept {
  return -p.r * (x.phi_dot + x.theta_dot);
}

struct Mip {
  static constexpr int kWheels = 2;
  static constexpr int kInputs = 2;  // u_x, u_z
  using Parameters = MipParameters;
  using Kinematics = MipKinematics;
  using Estimate = MipEstimate;
  using Sample = Measurement<kWheels>;
};

inline Vec3 body_rates(const MipEstimate& x) noexcept {
  return {x.theta_dot, std::sin(x.theta) * x.psi_dot, std::cos(x.theta) * x.psi_dot};
}

/// Robot-neutral view.
inline StateView view(const MipEstimate& x, const MipParameters&) noexcept {
  StateView v;
  v.theta_rad << x.theta, 0.0, x.psi;
  v.omega_B_rad_s = body_rates(x);
  v.phi_rad << x.phi, 0.0;
  v.phi_dot_rad_s << x.phi_dot, 0.0;
  v.position_W_m = x.position_W_m;
  v.normalized_innovation = x.normalized_innovation;
  return v;
}

/// A log does not hold all that the simulation knew.
inline bool recall(const StateView&, MipEstimate*) noexcept { return false; }

/// Attitude: lean. Speed: mean encoder rate, rad/s.
inline StateErrors errors(const StateView& x, const StateView& truth, const MipParameters&) noexcept {
  const double lean = x.theta_rad.x() - truth.theta_rad.x();
  const double speed = x.phi_dot_rad_s.x() - truth.phi_dot_rad_s.x();
  return {lean * lean, speed * speed, 1};
}

}  // namespace equipoise
