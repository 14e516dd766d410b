#include "equipoise/plant/coulomb.hpp"
#include "robots/mbbr/world.hpp"

namespace equipoise {

MbbrEngineWorld::MbbrEngineWorld(const MbbrParameters& robot, const MotorParameters& motor,
                                 const Calibration& calibration, const MbbrWorldParams& world, Engine& engine)
    : robot_(as_built(robot, world.common.actual)),
      world_(world),
      kinematics_(robot_),
      mobility_(MbbrDynamics(without_loose_wheels(robot_, world.drive)).relative_mobility()),
      motors_(motor, calibration, world.common),
      drive_(robot_, world.drive),
      body_(calibration, world.common, Mbbr::kWheels, (robot_.m_t + robot_.m_b) * kGravity_m_s2, engine) {}

Vec<kMaxMotors> MbbrEngineWorld::encoders() const noexcept {
  Vec<kMaxMotors> angles = Vec<kMaxMotors>::Zero();
  angles.head<3>() = kinematics_.wheels_from_ball(seen_B_rad_) + drive_.encoder_offset_rad();
  return angles;
}

/// Mass times specific force at the centre of mass, less the push: what the ball gives the body.
Vec3 MbbrEngineWorld::body_force_B() const noexcept {
  const EngineMotion& m = body_.motion();
  const Vec3 arm = robot_.l_a - Vec3(0.0, 0.0, robot_.l);
  const Vec3& w = m.omega_B_rad_s;
  const Vec2 push = push_force_W(world_.common, body_.time_s());
  return robot_.m_t * (m.specific_force_B_m_s2 - omega_dot_B_.cross(arm) - w.cross(w.cross(arm))) -
         m.R_WB.transpose().leftCols<2>() * push;
}

/// Motors and friction over this step; `others`: the relative rate at its end without them.
Vec3 MbbrEngineWorld::torque_B(const Vec3& rate, const Vec3& others, double h) noexcept {
  const double viscous = world_.common.friction ? robot_.mu_v + world_.extra_viscous_N_m_s : 0.0;
  const double coulomb =
      world_.common.friction ? robot_.mu_c * world_.common.friction_now(body_.time_s()) : 0.0;
  const Vec3 limit = friction_limit_N_m(world_, coulomb, rate);
  if (!drive_.slips()) {
    const Vec3 wheels = drive_.wheel_torques(motors_, rate);
    const Vec3 free = others + h * mobility_.cwiseProduct(drive_.torque_B(wheels, -viscous * rate));
    return drive_.torque_B(wheels, -viscous * rate + uncoupled_coulomb_torque(free, mobility_, h, limit));
  }
  const double beyond = drive_.share_beyond();
  Mat<6, 6> response = Mat<6, 6>::Identity();  // the floor is the engine's
  response.topLeftCorner<3, 3>() = h * mobility_.asDiagonal();
  Vec<6> free = Vec<6>::Zero();
  free.head<3>() = others - h * beyond * viscous * mobility_.cwiseProduct(rate);
  const Vec3 before = rotor_rad_s_ - drive_.wheel_rates(rate);
  const MbbrFriction f = contact_friction(response, free, beyond * limit,
                                          drive_.rotors(motors_, rotor_rad_s_, coulomb * world_.coulomb_scale,
                                                        world_.common.stiction, viscous, h),
                                          {});
  drive_.carry(body_force_B(), f.wheels);
  drive_.slip_by(h * before);
  rotor_rad_s_ = f.rotor_rad_s;
  return drive_.on_ball_B(f.wheels) + f.axes_B - beyond * viscous * rate;
}

void MbbrEngineWorld::step() {
  const double h = world_.common.step_s;
  const Vec3 rate = body_.motion().joint_rate_rad_s;
  drive_.begin_step(motors_, rate, kinematics_.wheels_from_ball(seen_B_rad_), h);
  const Vec3 omega = body_.motion().omega_B_rad_s;
  const Vec3 torque = torque_B(rate, rate + h * others_B_rad_s2_, h);
  body_.drive(torque, encoders());
  const Vec3 after = body_.motion().joint_rate_rad_s;
  omega_dot_B_ = (body_.motion().omega_B_rad_s - omega) / h;
  others_B_rad_s2_ = (after - rate) / h - mobility_.cwiseProduct(torque);
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
