#include "robots/mbbr/world.hpp"

#include <algorithm>

#include "equipoise/plant/coulomb.hpp"
#include "equipoise/plant/integrator.hpp"

namespace equipoise {
namespace {

constexpr double kRollingStart_m_s = 0.005;  // below it rolling resistance fades

using namespace mbbr_at;  // NOLINT(google-build-using-namespace): the places in the state

Vec<16> start_state(NoiseStream& noise, double sigma) {
  Vec<16> s = Vec<16>::Zero();
  s.segment<3>(kTheta) = noise.gaussian_vector<3>(sigma);
  return s;
}

MbbrDriveParams with_offset(const MbbrWorldParams& world) {
  MbbrDriveParams drive = world.drive;
  drive.com_offset_rad = world.common.com_offset_rad;
  return drive;
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
      drive_(robot_, with_offset(world)),
      floor_(robot_, world.floor),
      ground_(world.common.floor, robot_.r, world.common.seed),
      start_noise_(world.common.seed, kStartNoise),
      process_noise_(world.common.seed, kProcessNoise),
      loop_noise_(world.common.seed, kLoop),
      s_(start_state(start_noise_, world.common.initial_tilt_rad)),
      here_(s_),
      sensors_(calibration, world.common, Mbbr::kWheels, start_noise_, s_.segment<3>(kTheta)),
      uneven_(world.common.floor.uneven()),
      plain_(world.common.plain() && world.drive.even() && !floor_.limited()) {}

MbbrWorld::Here MbbrWorld::near(const State& s) const noexcept {
  return {here_, s, s(kTheta + 2) - s_(kTheta + 2)};
}

void MbbrWorld::arrive(const State& s) noexcept {
  here_ = near(s);
  s_ = s;
}

Vec3 friction_limit_N_m(const MbbrWorldParams& world, double mu_c, const Vec3& relative_rate_B) noexcept {
  Vec3 limit = sliding_friction_N_m<double>(mu_c * world.coulomb_scale, world.yaw_friction_scale.x(),
                                            world.yaw_friction_scale.y(), relative_rate_B);
  for (int i = 0; i < 3; ++i) limit(i) *= world.common.stiction.factor(relative_rate_B(i));
  return limit;
}

/// On a slope the whole weight pulls the ball downhill; rolling resistance holds it back. Yaw frame, N.
Vec2 MbbrWorld::pull_star(const Instant& now) const noexcept {
  Vec2 pull = Vec2::Zero();
  const double weight_N = (robot_.m_t + robot_.m_b) * kGravity_m_s2;
  const Vec2& slope = world_.common.floor_slope_rad;
  if (!slope.isZero(0.0)) pull = now.heading.back(-weight_N * slope);
  if (uneven_) pull += (robot_.m_t + robot_.m_b) * now.heading.back(ground_.pull_W_m_s2());
  if (world_.common.rolling_resistance != 0.0) {
    const Vec2 v = ball_velocity(robot_.r, now.motion.phi_dot_star);
    pull -= world_.common.rolling_resistance * weight_N * v / std::max(v.norm(), kRollingStart_m_s);
  }
  return pull;
}

double MbbrWorld::viscous_N_m_s() const noexcept {
  return world_.common.friction ? robot_.mu_v + world_.extra_viscous_N_m_s : 0.0;
}

void MbbrWorld::forces(Instant* now, const Vec2& push_W, const Vec3& friction_B) const noexcept {
  now->drive(wheels(), viscous_N_m_s(), friction_B);
  if (!push_W.isZero(0.0)) {
    now->loads.push_B = now->motion.R().topRows<2>().transpose() * now->heading.back(push_W);
  }
  now->loads.pull_star = pull_star(*now);
}

void MbbrWorld::rolling(Instant* now, const Vec2& push_W, const Vec3& friction_B) const noexcept {
  forces(now, push_W, friction_B);
  now->roll(dynamics_);
}

MbbrWorld::State MbbrWorld::slip_derivative(const State& s, const Here& now,
                                            const MbbrSlipAccelerations& a) const noexcept {
  const MbbrMotion& m = now.motion;
  const Vec3 theta_dot = m.theta_dot();
  const auto turning = [&](const Vec2& v) { return Vec2(theta_dot.z() * Vec2(v.y(), -v.x())); };
  const Vec2 slip = s.segment<2>(kSlip);
  const Vec2 slip_dot = a.centre_star - ball_velocity(robot_.r, a.ball_dot.head<2>());
  State d;
  d.segment<3>(kTheta) = theta_dot;
  d.segment<3>(kOmega) = a.omega_dot_B;
  d.segment<2>(kPhiDot) = a.ball_dot.head<2>() + turning(m.phi_dot_star);
  d.segment<2>(kPhi) = now.heading(m.phi_dot_star + Vec2(-slip.y(), slip.x()) / robot_.r);
  d.segment<3>(kRelative) = drive_.seen_rate_B(now.relative_B);
  d.segment<2>(kSlip) = slip_dot + turning(slip);
  d(kSpin) = a.ball_dot.z();
  return d;
}

Vec3 MbbrWorld::friction_limit_B(const Instant& now) const noexcept {
  if (!world_.common.friction) return Vec3::Zero();
  return friction_limit_N_m(world_, robot_.mu_c * world_.common.friction_now(time_s_), now.relative_B);
}

/// Per axis, the constant torque that would end this step at rest, limited to friction's: sticking and
/// sliding in one rule.
Vec3 MbbrWorld::coulomb_torque_B(const Instant& free) const noexcept {
  if (!world_.common.friction) return Vec3::Zero();
  const double h = world_.common.step_s;
  return uncoupled_coulomb_torque<double, 3>(free.relative_after(h), mobility_, h, friction_limit_B(free));
}

/// The same where the floor may give way: all axes, the slip and the spin together.
MbbrFriction MbbrWorld::slip_friction(const State& s, const Instant& free, double h) const noexcept {
  const auto mass = floor_.mass(free.motion);
  const MbbrSlipAccelerations a = floor_.accelerations(free.motion, mass, free.loads, {});
  const State next = s + h * slip_derivative(s, free, a);
  Vec<6> rates;
  rates << near(next).relative_B, next.segment<3>(kSlip);
  const double normal = needed(free, felt_as_rolling(a, robot_.r)).normal_N;
  return floor_.friction(free.motion, mass, rates, h, friction_limit_B(free), normal);
}

/// What the floor must carry; one that lifts the robot carries more.
MbbrFloorForce MbbrWorld::needed(const Instant& now, const MbbrAccelerations& a) const noexcept {
  MbbrFloorForce f = floor_.needed(now.motion, now.loads, a);
  f.normal_N += (robot_.m_t + robot_.m_b) * ground_.lift_m_s2();
  return f;
}

Felt MbbrWorld::felt(const MbbrMotion& m, const MbbrAccelerations& a) const noexcept {
  return felt(m.omega_B, -dynamics_.accelerometer_B(m, a) + ground_.lift_m_s2() * m.R().row(2).transpose());
}

Felt MbbrWorld::felt(const Vec3& omega_B, const Vec3& specific_force_B) const noexcept {
  Felt felt;
  felt.time_s = time_s_;
  felt.omega_B_rad_s = omega_B;
  felt.specific_force_B_m_s2 = specific_force_B;
  felt.wheel_angle_rad.head<3>() =
      kinematics_.wheels_from_ball(s_.segment<3>(kRelative)) + drive_.encoder_offset_rad();
  return felt;
}

void MbbrWorld::disturb() {
  if (world_.process_noise_sigma.isZero(0.0)) return;
  Vec<10> v;
  for (int i = 0; i < 10; ++i) v(i) = process_noise_.gaussian(world_.process_noise_sigma(i));
  Vec3 theta_dot = here_.motion.theta_dot();
  State s = s_;
  s.segment<3>(kTheta) += v.head<3>();
  theta_dot += v.segment<3>(5);
  s.segment<3>(kOmega) = body_rates(s.segment<2>(kTheta), theta_dot);
  s.segment<2>(kPhiDot) += v.tail<2>();
  s.segment<2>(kPhi) += rotate(s(kTheta + 2), Vec2(v(3), v(4)));
  s.segment<2>(kRelative) += Vec2(v(3) - v(0), v(4) - v(1));
  s(kRelative + 2) -= v(2);
  s_ = s;
}

void MbbrWorld::load_wheels(const Instant& now, const Vec3& friction_B, const MbbrAccelerations& a,
                            double h) noexcept {
  if (!drive_.slips()) return;
  const Vec3 total_B = now.viscous_B + friction_B;
  const Vec3 force_B = -robot_.m_t * dynamics_.accelerometer_B(now.motion, a, Vec3(0.0, 0.0, robot_.l));
  drive_.slip_over(motors_, now.wheel_torque, total_B, h);
  drive_.carry(force_B - now.loads.push_B, now.wheel_torque, total_B);
}

void MbbrWorld::step(double h) noexcept {
  if (uneven_) {
    const Vec2 slip = s_.segment<2>(kSlip);
    ground_.begin_step(ball_velocity(robot_.r, Vec2(s_.segment<2>(kPhi))),
                       here_.heading(Vec2(ball_velocity(robot_.r, here_.motion.phi_dot_star) + slip)), h);
  }
  drive_.begin_step(motors_, here_.relative_B, kinematics_.wheels_from_ball(s_.segment<3>(kRelative)), h);
  const Vec2 push = push_now();
  Instant free(here_);
  rolling(&free, push, Vec3::Zero());
  if (!slipping_) {
    friction_.axes_B = coulomb_torque_B(free);
    const Instant now = free.with_friction(dynamics_, wheels(), friction_.axes_B);
    slipping_ = floor_.limited() && !floor_.carries(needed(now, now.a));
    if (!slipping_) {
      if (sensors_.aged()) sensors_.feel(felt(now.motion, now.a));
      load_wheels(now, friction_.axes_B, now.a, h);
      arrive(rk4_step(s_, now.derivative(wheels()), h, [&](const State& s) {
        Instant then(near(s));
        rolling(&then, push, friction_.axes_B);
        return then.derivative(wheels());
      }));
      time_s_ += h;
      return;
    }
  }
  friction_ = slip_friction(s_, free, h);
  const auto sliding = [&](const Here& here) {
    Instant now(here);
    forces(&now, push, friction_.axes_B);
    return floor_.accelerations(now.motion, floor_.mass(now.motion), now.loads, friction_.floor);
  };
  const MbbrSlipAccelerations a = sliding(here_);
  const MbbrAccelerations felt_a = felt_as_rolling(a, robot_.r);
  if (sensors_.aged()) sensors_.feel(felt(free.motion, felt_a));
  load_wheels(free, friction_.axes_B, felt_a, h);
  State next = rk4_step(s_, slip_derivative(s_, free, a), h, [&](const State& s) {
    const Here now = near(s);
    return slip_derivative(s, now, sliding(now));
  });
  if (friction_.floor_holds) {
    next.segment<3>(kSlip).setZero();
    slipping_ = false;
  }
  arrive(next);
  time_s_ += h;
}

void MbbrWorld::advance(const MotorCommand& command) {
  advance_tick(command);
  const double missed = world_.common.missed_tick_share;
  if (missed > 0.0 && loop_noise_.uniform(0.0, 1.0) < missed) advance_tick(command);
}

void MbbrWorld::advance_tick(const MotorCommand& command) {
  if (command.enable) held_ = false;
  rolled_ = false;
  const double h = world_.common.step_s;
  const int steps = steps_per_tick();
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
    motors_.update_battery(kinematics_.wheels_from_ball(here_.relative_B));
  } else {
    end_tick();
  }
}

void MbbrWorld::end_tick() noexcept {
  disturb();
  here_ = Here(s_);  // anew once a tick: what a step adds is exact but for the last digit
  motors_.update_battery(kinematics_.wheels_from_ball(here_.relative_B));
}

int MbbrWorld::steps_per_tick() const noexcept {
  return static_cast<int>(std::lround(kTickS / world_.common.step_s));
}

bool MbbrWorld::begin_rolling(const MotorCommand& command, Rolling* robot) noexcept {
  if (!plain_ || !command.enable || slipping_) return false;
  held_ = false;
  motors_.command(command);
  Eigen::Map<State>(robot->state) = s_;
  robot->bodies = bodies(robot_);
  Eigen::Map<Vec3>(robot->mobility) = mobility_;
  robot->viscous_N_m_s = viscous_N_m_s();
  robot->coulomb_N_m = world_.common.friction ? robot_.mu_c * world_.coulomb_scale : 0.0;
  robot->yaw_positive = world_.yaw_friction_scale.x();
  robot->yaw_negative = world_.yaw_friction_scale.y();
  robot->ratio = robot_.r / robot_.r_w;
  Eigen::Map<Mat3>(robot->T_ob) = kinematics_.T_ob();
  robot->bridges = *motors_.bridges();
  robot->supply = motors_.supply();
  std::copy_n(command.duty, Mbbr::kWheels, robot->duty);
  return true;
}

void MbbrWorld::end_rolling(const Rolling& robot) noexcept {
  s_ = Eigen::Map<const State>(robot.state);
  for (int i = 0; i < steps_per_tick(); ++i) time_s_ += world_.common.step_s;
  rolled_ = world_.process_noise_sigma.isZero(0.0);
  rolled_force_B_ = Eigen::Map<const Vec3>(robot.specific_force_B);
  end_tick();
}

Felt MbbrWorld::felt_now() const noexcept {
  if (rolled_) return felt(s_.segment<3>(kOmega), rolled_force_B_);
  if (slipping_) {
    Instant now(here_);
    forces(&now, push_now(), friction_.axes_B);
    const MbbrSlipAccelerations a =
        floor_.accelerations(now.motion, floor_.mass(now.motion), now.loads, friction_.floor);
    return felt(now.motion, felt_as_rolling(a, robot_.r));
  }
  Instant now(here_);
  rolling(&now, push_now(), Vec3::Zero());
  if (!held_) now = now.with_friction(dynamics_, wheels(), coulomb_torque_B(now));
  return felt(now.motion, now.a);
}

RawSample MbbrWorld::sense() {
  TrueMotion now;
  now.time_s = time_s_;
  now.theta_rad = s_.segment<3>(kTheta);
  const Felt here = felt_now();
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
