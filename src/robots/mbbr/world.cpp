#include "robots/mbbr/world.hpp"

#include "equipoise/plant/coulomb.hpp"

namespace equipoise {
namespace {

enum At : int { kTheta = 0, kOmega = 3, kPhiDot = 6, kPhi = 8, kRelative = 10 };

Vec<13> start_state(NoiseStream& noise, double sigma) {
  Vec<13> s = Vec<13>::Zero();
  s.segment<3>(kTheta) = noise.gaussian_vector<3>(sigma);
  return s;
}

}  // namespace

MbbrWorld::MbbrWorld(const MbbrParameters& robot, const MotorParameters& motor,
                     const Calibration& calibration, const MbbrWorldParams& world)
    : robot_(robot),
      world_(world),
      kinematics_(robot),
      dynamics_(robot),
      mobility_(dynamics_.relative_mobility()),
      motors_(motor, calibration, world.common),
      drive_(robot, motor, world.drive),
      start_noise_(world.common.seed, kStartNoise),
      process_noise_(world.common.seed, kProcessNoise),
      s_(start_state(start_noise_, world.common.initial_tilt_rad)),
      sensors_(calibration, world.common, Mbbr::kWheels, start_noise_, s_.segment<3>(kTheta)) {}

MbbrMotion MbbrWorld::motion(const State& s) noexcept {
  return {s.segment<2>(kTheta), s.segment<3>(kOmega), s.segment<2>(kPhiDot)};
}

Vec3 friction_limit_N_m(const MbbrWorldParams& world, double mu_c, const Vec3& relative_rate_B) noexcept {
  Vec3 limit = Vec3::Constant(mu_c * world.coulomb_scale);
  limit.z() *= relative_rate_B.z() >= 0.0 ? world.yaw_friction_scale.x() : world.yaw_friction_scale.y();
  for (int i = 0; i < 3; ++i) limit(i) *= world.common.stiction.factor(relative_rate_B(i));
  return limit;
}

Vec3 MbbrWorld::viscous_torque_B(const Vec3& relative_rate_B) const noexcept {
  return -(robot_.mu_v + world_.extra_viscous_N_m_s) * relative_rate_B;
}

/// On a slope the whole weight pulls the ball downhill, yaw frame, N.
Vec2 MbbrWorld::slope_pull_star(double theta_z) const noexcept {
  const Vec2& slope = world_.common.floor_slope_rad;
  if (slope.isZero(0.0)) return Vec2::Zero();
  return rotate(-theta_z, Vec2(-(robot_.m_t + robot_.m_b) * kGravity_m_s2 * slope));
}

MbbrAccelerations MbbrWorld::accelerations(const State& s, const Vec3& friction_B,
                                           const Vec2& push_W) const noexcept {
  const MbbrMotion m = motion(s);
  const Vec3 relative = MbbrDynamics::encoder_rate_B(m);
  Vec3 tau = drive_.torque_B(motors_, relative) + friction_B;
  if (world_.common.friction) tau += viscous_torque_B(relative);
  Vec3 push_B = Vec3::Zero();
  if (!push_W.isZero(0.0)) {
    const Mat3 R_WB = rotation(quaternion_of(s.segment<3>(kTheta)));
    push_B = R_WB.transpose() * Vec3(push_W.x(), push_W.y(), 0.0);
  }
  return dynamics_.accelerations(m, tau, push_B, slope_pull_star(s(kTheta + 2)));
}

MbbrWorld::State MbbrWorld::derivative(const State& s, const Vec3& friction_B,
                                       const Vec2& push_W) const noexcept {
  const MbbrMotion m = motion(s);
  const MbbrAccelerations a = accelerations(s, friction_B, push_W);
  const double theta_z = s(kTheta + 2);
  State d;
  d.segment<3>(kTheta) = m.theta_dot();
  d.segment<3>(kOmega) = a.omega_dot_B;
  d.segment<2>(kPhiDot) = MbbrDynamics::phi_star_ddot(m, a);
  d.segment<2>(kPhi) = rotate(theta_z, m.phi_dot_star);
  d.segment<3>(kRelative) = drive_.seen_rate_B(MbbrDynamics::encoder_rate_B(m));
  return d;
}

/// Per axis, the constant torque that would end this step at rest, limited to friction's: sticking and
/// sliding in one rule.
Vec3 MbbrWorld::coulomb_torque_B(const State& s, const Vec2& push_W) const noexcept {
  if (!world_.common.friction) return Vec3::Zero();
  const double h = world_.common.step_s;
  const State next = s + h * derivative(s, Vec3::Zero(), push_W);
  const Vec3 limit = friction_limit_N_m(world_, robot_.mu_c, MbbrDynamics::encoder_rate_B(motion(s)));
  return uncoupled_coulomb_torque<3>(MbbrDynamics::encoder_rate_B(motion(next)), mobility_, h, limit);
}

void MbbrWorld::disturb() {
  if (world_.process_noise_sigma.isZero(0.0)) return;
  Vec<10> v;
  for (int i = 0; i < 10; ++i) v(i) = process_noise_.gaussian(world_.process_noise_sigma(i));
  const MbbrMotion before = motion(s_);
  Vec3 theta_dot = before.theta_dot();
  s_.segment<3>(kTheta) += v.head<3>();
  theta_dot += v.segment<3>(5);
  s_.segment<3>(kOmega) = body_rates(s_.segment<2>(kTheta), theta_dot);
  s_.segment<2>(kPhiDot) += v.tail<2>();
  s_.segment<2>(kPhi) += rotate(s_(kTheta + 2), Vec2(v(3), v(4)));
  s_.segment<2>(kRelative) += Vec2(v(3) - v(0), v(4) - v(1));
  s_(kRelative + 2) -= v(2);
}

void MbbrWorld::step(double h) noexcept {
  drive_.begin_step(motors_, MbbrDynamics::encoder_rate_B(motion(s_)),
                    kinematics_.wheels_from_ball(s_.segment<3>(kRelative)), h);
  const Vec2 push = push_now();
  const Vec3 friction = coulomb_torque_B(s_, push);
  const State k1 = derivative(s_, friction, push);
  const State k2 = derivative(s_ + 0.5 * h * k1, friction, push);
  const State k3 = derivative(s_ + 0.5 * h * k2, friction, push);
  const State k4 = derivative(s_ + h * k3, friction, push);
  s_ += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  time_s_ += h;
}

void MbbrWorld::advance(const MotorCommand& command) {
  if (command.enable) held_ = false;
  const int steps = static_cast<int>(std::lround(kTickS / world_.common.step_s));
  for (int i = 0; i < steps && !held_; ++i) {
    if (i == world_.common.actuation_latency_steps) motors_.command(command);
    step(world_.common.step_s);
  }
  if (held_) {
    time_s_ += kTickS;
  } else {
    disturb();
  }
  motors_.update_battery(kinematics_.wheels_from_ball(MbbrDynamics::encoder_rate_B(motion(s_))));
}

RawSample MbbrWorld::sense() {
  const MbbrMotion m = motion(s_);
  TrueMotion now;
  now.time_s = time_s_;
  now.theta_rad = s_.segment<3>(kTheta);
  now.omega_B_rad_s = m.omega_B;
  if (held_) {
    now.specific_force_B_m_s2 =
        rotation(quaternion_of(now.theta_rad)).transpose() * Vec3(0.0, 0.0, kGravity_m_s2);
  } else {
    const Vec2 push = push_now();
    const MbbrAccelerations a = accelerations(s_, coulomb_torque_B(s_, push), push);
    now.specific_force_B_m_s2 = -dynamics_.accelerometer_B(m, a);
  }
  const Vec3 wheels = kinematics_.wheels_from_ball(s_.segment<3>(kRelative)) + drive_.encoder_offset_rad();
  for (int i = 0; i < 3; ++i) now.wheel_angle_rad[static_cast<std::size_t>(i)] = wheels(i);
  now.battery_V = motors_.battery_V();
  return sensors_.sense(now);
}

MbbrEstimate MbbrWorld::truth() const noexcept {
  MbbrEstimate x;
  x.theta_xy = s_.segment<2>(kTheta);
  x.theta_z = s_(kTheta + 2);
  x.omega_B = s_.segment<3>(kOmega);
  x.theta_dot = euler_rates(x.theta_xy, x.omega_B);
  x.phi_dot_star = s_.segment<2>(kPhiDot);
  x.phi = s_.segment<2>(kPhi);
  return x;
}

}  // namespace equipoise
