#include "robots/mbbr/engine_world.hpp"

#include "equipoise/plant/coulomb.hpp"

namespace equipoise {

MbbrEngineWorld::MbbrEngineWorld(const MbbrParameters& robot, const MotorParameters& motor,
                                 const Calibration& calibration, const MbbrWorldParams& world, Engine& engine)
    : robot_(as_built(robot, world.common.actual)),
      world_(world),
      kinematics_(robot_),
      mobility_(MbbrDynamics(robot_).relative_mobility()),
      motors_(motor, calibration, world.common),
      drive_(robot_, world.drive),
      body_(calibration, world.common, Mbbr::kWheels, (robot_.m_t + robot_.m_b) * kGravity_m_s2, engine) {}

Vec<kMaxMotors> MbbrEngineWorld::encoders() const noexcept {
  Vec<kMaxMotors> angles = Vec<kMaxMotors>::Zero();
  angles.head<3>() = kinematics_.wheels_from_ball(seen_B_rad_) + drive_.encoder_offset_rad();
  return angles;
}

void MbbrEngineWorld::step() {
  const double h = world_.common.step_s;
  const Vec3 rate = body_.motion().joint_rate_rad_s;
  drive_.begin_step(motors_, rate, kinematics_.wheels_from_ball(seen_B_rad_), h);
  const Vec3 wheels = drive_.wheel_torques(motors_, rate);
  Vec3 friction = Vec3::Zero();
  if (world_.common.friction) {
    friction = -(robot_.mu_v + world_.extra_viscous_N_m_s) * rate;
    const Vec3 free =
        rate + h * (others_B_rad_s2_ + mobility_.cwiseProduct(drive_.torque_B(wheels, friction)));
    friction += uncoupled_coulomb_torque<double, 3>(free, mobility_, h,
                                                    friction_limit_N_m(world_, robot_.mu_c, rate));
  }
  const Vec3 torque = drive_.torque_B(wheels, friction);
  body_.drive(torque, encoders());
  const Vec3 after = body_.motion().joint_rate_rad_s;
  others_B_rad_s2_ = (after - rate) / h - mobility_.cwiseProduct(torque);
  if (drive_.slips()) {
    drive_.slip_over(motors_, wheels, friction, h);
    drive_.carry(robot_.m_t * body_.motion().specific_force_B_m_s2, wheels, friction);
  }
  seen_B_rad_ += h * drive_.seen_rate_B(0.5 * (rate + after));
}

void MbbrEngineWorld::advance(const MotorCommand& command) {
  body_.advance(command, motors_, [this] { step(); });
  motors_.update_battery(kinematics_.wheels_from_ball(body_.motion().joint_rate_rad_s));
}

MbbrEstimate MbbrEngineWorld::truth() const noexcept {
  const EngineMotion& m = body_.motion();
  const Vec3 theta = body_.theta_rad();
  MbbrEstimate x;
  x.theta_xy = theta.head<2>();
  x.theta_z = theta.z();
  x.omega_B = m.omega_B_rad_s;
  x.theta_dot = euler_rates(x.theta_xy, x.omega_B);
  x.phi_dot_star = ball_rate(robot_.r, Turn(theta.z()).back(m.velocity_W_m_s.head<2>()));
  x.phi = ball_rate(robot_.r, m.position_W_m.head<2>());
  return x;
}

}  // namespace equipoise
