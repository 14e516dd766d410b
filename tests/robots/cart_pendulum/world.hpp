// The cart-pendulum's simulated world: exact planar dynamics in RK4, four motors, sensors.
// In: motor command per tick -> out: raw samples, and the truth. A hand holds the pendulum until the motors
// are first enabled. Simulation only.
#pragma once

#include "equipoise/plant/integrator.hpp"
#include "equipoise/plant/motors.hpp"
#include "equipoise/plant/sensors.hpp"
#include "robots/cart_pendulum/cart_pendulum.hpp"

namespace equipoise {

class CartPendulumWorld {
 public:
  CartPendulumWorld(const CartPendulumParameters& robot, const MotorParameters& motor,
                    const Calibration& calibration, const WorldParams& world)
      : robot_(robot),
        world_(world),
        motors_(motor, calibration, world),
        start_noise_(world.seed, kStartNoise),
        s_(start_noise_.gaussian(world.initial_tilt_rad), 0.0, 0.0, 0.0),
        sensors_(calibration, world, CartPendulum::kWheels, start_noise_, Vec3(0.0, s_(0), 0.0)) {}

  void advance(const MotorCommand& command) {
    held_ = held_ && !command.enable;
    motors_.command(command);
    const double h = world_.step_s;
    const int steps = static_cast<int>(std::lround(kTickS / h));
    for (int i = 0; i < steps && !held_; ++i)
      s_ = rk4_step(s_, derivative(s_), h, [this](const Vec<4>& s) { return derivative(s); });
    time_s_ += kTickS;
  }

  void without_attitude() noexcept { sensors_.without_attitude(); }

  RawSample sense() {
    const Vec<4> d = derivative(s_);
    const double x_ddot = held_ ? 0.0 : robot_.wheel_radius_m * d(3);
    const double sin = std::sin(s_(0));
    const double cos = std::cos(s_(0));
    TrueMotion m;
    m.time_s = time_s_;
    m.theta_rad.y() = s_(0);
    m.omega_B_rad_s.y() = s_(2);
    // R_WB^T (x'' + g), R_WB a turn about y.
    m.specific_force_B_m_s2 << cos * x_ddot - sin * kGravity_m_s2, 0.0, sin * x_ddot + cos * kGravity_m_s2;
    m.wheel_angle_rad.fill(s_(1));
    m.battery_V = motors_.battery_V();
    return sensors_.sense(m);
  }

  CartPendulumEstimate truth() const noexcept { return {s_(0), s_(2), s_(1), s_(3)}; }
  double time_s() const noexcept { return time_s_; }

 private:
  /// Lean, wheel angle, and their rates.
  Vec<4> derivative(const Vec<4>& s) const noexcept {
    const double r = robot_.wheel_radius_m;
    const double ml = robot_.pendulum_mass_kg * robot_.com_height_m;
    const double sin = std::sin(s(0));
    const double cos = std::cos(s(0));
    const double push = push_force_W(world_, time_s_).x();
    const double force = motors_.torque(Vec<4>::Constant(s(3))).sum() / r + ml * sin * s(2) * s(2) + push;
    const double moment = ml * kGravity_m_s2 * sin;
    const double m11 = robot_.cart_mass_kg + robot_.pendulum_mass_kg;
    const double m12 = ml * cos;
    const double m22 = robot_.inertia_kg_m2 + ml * robot_.com_height_m;
    const double det = m11 * m22 - m12 * m12;
    return {s(2), s(3), (m11 * moment - m12 * force) / det, (m22 * force - m12 * moment) / det / r};
  }

  CartPendulumParameters robot_;
  WorldParams world_;
  SimulatedMotors<CartPendulum::kWheels> motors_;
  NoiseStream start_noise_;
  Vec<4> s_;
  SimulatedSensors sensors_;
  double time_s_ = 0.0;
  bool held_ = true;
};

}  // namespace equipoise
