#include "robots/mbbr/world.hpp"

#include "equipoise/plant/coulomb.hpp"
#include "equipoise/plant/integrator.hpp"

namespace equipoise {
namespace {

enum At : int { kTheta = 0, kOmega = 3, kPhiDot = 6, kPhi = 8, kRelative = 10 };

Vec<13> start_state(NoiseStream& noise, double sigma) {
  Vec<13> s = Vec<13>::Zero();
  s.segment<3>(kTheta) = noise.gaussian_vector<3>(sigma);
  return s;
}

}  // namespace

MbbrParameters as_built(MbbrParameters p, const ActualScales& actual) noexcept {
  p.m_t *= actual.body_mass;
  p.l *= actual.com_height;
  p.I_t1 *= actual.body_inertia;
  p.I_t2 *= actual.body_inertia;
  p.I_t3 *= actual.body_inertia;
  p.m_b *= actual.ball_mass;
  p.r *= actual.ball_radius;
  p.I_b *= actual.ball_mass * actual.ball_radius * actual.ball_radius;
  p.r_w *= actual.wheel_radius;
  const double gearing = actual.ball_radius / actual.wheel_radius;  // wheels and rotors stay what they are
  p.I_w *= gearing * gearing;
  return p;
}

MbbrWorld::MbbrWorld(const MbbrParameters& robot, const MotorParameters& motor,
                     const Calibration& calibration, const MbbrWorldParams& world)
    : robot_(as_built(robot, world.common.actual)),
      world_(world),
      kinematics_(robot_),
      dynamics_(robot_),
      mobility_(dynamics_.relative_mobility()),
      motors_(motor, calibration, world.common),
      drive_(robot_, world.drive),
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

/// On a slope the whole weight pulls the ball downhill, yaw frame, N.
Vec2 MbbrWorld::slope_pull_star(double theta_z) const noexcept {
  const Vec2& slope = world_.common.floor_slope_rad;
  if (slope.isZero(0.0)) return Vec2::Zero();
  return rotate(-theta_z, Vec2(-(robot_.m_t + robot_.m_b) * kGravity_m_s2 * slope));
}

MbbrWorld::Instant MbbrWorld::without_coulomb(const State& s, const Vec2& push_W) const noexcept {
  Instant now;
  now.motion = motion(s);
  now.mass = dynamics_.mass(now.motion);
  const Vec3 relative = MbbrDynamics::encoder_rate_B(now.motion);
  MbbrLoads loads;
  loads.tau_B = drive_.torque_B(motors_, relative);
  if (world_.common.friction) loads.tau_B -= (robot_.mu_v + world_.extra_viscous_N_m_s) * relative;
  const double theta_z = s(kTheta + 2);
  if (!push_W.isZero(0.0)) {
    loads.push_B = now.motion.R().topRows<2>().transpose() * rotate(-theta_z, push_W);
  }
  loads.pull_star = slope_pull_star(theta_z);
  now.a = dynamics_.accelerations(now.motion, now.mass, loads);
  return now;
}

MbbrWorld::Instant MbbrWorld::with_torque(const Instant& free, const Vec3& torque_B) const noexcept {
  Instant now = free;
  const MbbrAccelerations more = dynamics_.response(free.motion, free.mass, torque_B);
  now.a.omega_dot_B += more.omega_dot_B;
  now.a.phi_ddot_inertial += more.phi_ddot_inertial;
  return now;
}

MbbrWorld::State MbbrWorld::derivative(const State& s, const Instant& now) const noexcept {
  const MbbrMotion& m = now.motion;
  State d;
  d.segment<3>(kTheta) = m.theta_dot();
  d.segment<3>(kOmega) = now.a.omega_dot_B;
  d.segment<2>(kPhiDot) = MbbrDynamics::phi_star_ddot(m, now.a);
  d.segment<2>(kPhi) = rotate(s(kTheta + 2), m.phi_dot_star);
  d.segment<3>(kRelative) = drive_.seen_rate_B(MbbrDynamics::encoder_rate_B(m));
  return d;
}

/// Per axis, the constant torque that would end this step at rest, limited to friction's: sticking and
/// sliding in one rule.
Vec3 MbbrWorld::coulomb_torque_B(const State& s, const Instant& free) const noexcept {
  if (!world_.common.friction) return Vec3::Zero();
  const double h = world_.common.step_s;
  const State next = s + h * derivative(s, free);
  const Vec3 limit = friction_limit_N_m(world_, robot_.mu_c, MbbrDynamics::encoder_rate_B(free.motion));
  return uncoupled_coulomb_torque<3>(MbbrDynamics::encoder_rate_B(motion(next)), mobility_, h, limit);
}

Felt MbbrWorld::felt(const Instant& now) const noexcept {
  Felt felt;
  felt.time_s = time_s_;
  felt.omega_B_rad_s = now.motion.omega_B;
  felt.specific_force_B_m_s2 = -dynamics_.accelerometer_B(now.motion, now.a);
  felt.wheel_angle_rad.head<3>() =
      kinematics_.wheels_from_ball(s_.segment<3>(kRelative)) + drive_.encoder_offset_rad();
  return felt;
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
  const Instant free = without_coulomb(s_, push);
  const Vec3 friction = coulomb_torque_B(s_, free);
  const Instant now = with_torque(free, friction);
  if (sensors_.aged()) sensors_.feel(felt(now));
  s_ = rk4_step(s_, derivative(s_, now), h, [&](const State& s) {
    return derivative(s, with_torque(without_coulomb(s, push), friction));
  });
  time_s_ += h;
}

void MbbrWorld::advance(const MotorCommand& command) {
  if (command.enable) held_ = false;
  const double h = world_.common.step_s;
  const int steps = static_cast<int>(std::lround(kTickS / h));
  const double taken_at = world_.common.actuation_steps();
  for (int i = 0; i < steps && !held_; ++i) {
    const double part = taken_at - i;
    if (part > 0.0 && part < 1.0) {  // the PWM takes the duty within this step
      step(part * h);
      motors_.command(command);
      step((1.0 - part) * h);
    } else {
      if (part == 0.0) motors_.command(command);
      step(h);
    }
  }
  if (held_) {
    time_s_ += kTickS;
  } else {
    disturb();
  }
  motors_.update_battery(kinematics_.wheels_from_ball(MbbrDynamics::encoder_rate_B(motion(s_))));
}

RawSample MbbrWorld::sense() {
  TrueMotion now;
  now.time_s = time_s_;
  now.theta_rad = s_.segment<3>(kTheta);
  const Instant free = without_coulomb(s_, push_now());
  const Felt here = felt(held_ ? free : with_torque(free, coulomb_torque_B(s_, free)));
  now.omega_B_rad_s = here.omega_B_rad_s;
  now.specific_force_B_m_s2 = here.specific_force_B_m_s2;
  if (held_) {
    now.specific_force_B_m_s2 =
        rotation(quaternion_of(now.theta_rad)).transpose() * Vec3(0.0, 0.0, kGravity_m_s2);
  }
  for (int i = 0; i < 3; ++i) now.wheel_angle_rad[static_cast<std::size_t>(i)] = here.wheel_angle_rad(i);
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
