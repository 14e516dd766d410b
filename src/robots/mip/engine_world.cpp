#include "robots/mip/world.hpp"

namespace equipoise {

MipEngineWorld::MipEngineWorld(const MipParameters& robot, const MotorParameters& motor,
                               const Calibration& calibration, const MipWorldParams& world, Engine& engine)
    : robot_(as_built(robot, world.common.actual)),
      world_(world),
      kinematics_(robot_),
      mobility_(wheel_mobility(robot_)),
      motors_(motor, calibration, world.common),
      body_(calibration, world.common, Mip::kWheels, (robot_.m_b + 2.0 * robot_.m_w) * kGravity_m_s2,
            engine) {}

Vec<kMaxMotors> MipEngineWorld::encoders() const noexcept {
  Vec<kMaxMotors> angles = Vec<kMaxMotors>::Zero();
  angles.head<2>() = wheel_angle_rad_ + Vec2(gears_[0].ahead_rad(), gears_[1].ahead_rad());
  return angles;
}

void MipEngineWorld::step() {
  const double h = world_.common.step_s;
  const MipDrivetrain& d = world_.drivetrain;
  const Vec2 rate = wheel_rates();
  const Vec2 crossing = motors_.torque(rate + Vec2(gears_[0].rate_rad_s(), gears_[1].rate_rad_s()));
  Vec2 torque = motors_.torque(rate).cwiseProduct(d.motor_gain);
  if (world_.common.friction) torque -= robot_.mu_v * rate;
  for (int i = 0; i < 2; ++i) {
    if (!gears_[static_cast<std::size_t>(i)].step(d.gear, crossing(i), h)) torque(i) = 0.0;
  }
  if (world_.common.friction) {
    Vec2 limit = world_.common.friction_now(body_.time_s()) * (robot_.mu_c * d.friction_gain);
    for (int i = 0; i < 2; ++i) limit(i) *= world_.common.stiction.factor(rate(i));
    const Vec2 free = rate + h * (others_rad_s2_ + mobility_ * torque);
    torque += coulomb_torque(free, mobility_, h, limit);
  }
  body_.drive(Vec3(torque.x(), torque.y(), 0.0), encoders());
  others_rad_s2_ = (wheel_rates() - rate) / h - mobility_ * torque;
  wheel_angle_rad_ += 0.5 * h * (rate + wheel_rates());
}

void MipEngineWorld::advance(const MotorCommand& command) {
  body_.advance(command, motors_, [this] { step(); });
  motors_.update_battery(wheel_rates());
}

MipEstimate MipEngineWorld::truth() const noexcept {
  const EngineMotion& m = body_.motion();
  const Vec3 theta = body_.theta_rad();
  MipEstimate x;
  x.theta = theta.x();
  x.psi = theta.z();
  x.theta_dot = m.omega_B_rad_s.x();
  x.psi_dot = m.omega_B_rad_s.y() * std::sin(x.theta) + m.omega_B_rad_s.z() * std::cos(x.theta);
  x.phi = kinematics_.phi(wheel_angle_rad_);
  x.phi_dot = kinematics_.phi(wheel_rates());
  x.position_W_m = m.position_W_m.head<2>();
  return x;
}

}  // namespace equipoise
