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

MbbrParameters without_loose_wheels(MbbrParameters p, const MbbrDriveParams& drive) noexcept {
  if (drive.wheel_grip != 0.0) p.I_w = 0.0;
  return p;
}

MbbrWorld::MbbrWorld(const MbbrParameters& robot, const MotorParameters& motor,
                     const Calibration& calibration, const MbbrWorldParams& world)
    : TickedWorld(motor, calibration, world.common),
      robot_(as_built(robot, world.common.actual)),
      world_(world),
      kinematics_(robot_),
      dynamics_(robot_),
      mobility_(dynamics_.relative_mobility()),
      drive_(robot_, with_offset(world)),
      floor_(robot_, world.floor),
      loose_(without_loose_wheels(robot_, world.drive), world.floor),
      ground_(world.common.floor, robot_.r, world.common.seed),
      s_(start_state(start_noise_, world.common.initial_tilt_rad)),
      here_(s_),
      sensors_(calibration, world.common, Mbbr::kWheels, start_noise_, s_.segment<3>(kTheta)),
      uneven_(world.common.floor.uneven()),
      limited_(floor_.limited() || drive_.slips()) {}

MbbrWorld::Here MbbrWorld::near(const State& s) const noexcept {
  return {here_, s, s(kTheta + 2) - s_(kTheta + 2)};
}

void MbbrWorld::arrive(const State& s) noexcept {
  here_ = near(s);
  s_ = s;
}

Vec3 friction_limit_N_m(const MbbrWorldParams& world, double mu_c, const Vec3& relative_rate_B) noexcept {
  Vec3 limit = Vec3::Constant(mu_c * world.coulomb_scale);
  limit.z() *= world.yaw_friction_scale(relative_rate_B.z() >= 0.0 ? 0 : 1);
  for (int i = 0; i < 3; ++i) limit(i) *= world.common.stiction.factor(relative_rate_B(i));
  return limit;
}

/// On a slope the whole weight pulls the ball downhill; rolling resistance holds it back. Yaw frame, N.
Vec2 MbbrWorld::pull_star(const Instant& now) const noexcept {
  Vec2 pull = Vec2::Zero();
  const double weight_N = (robot_.m_t + robot_.m_b) * kGravity_m_s2;
  const Vec2& slope = common_.floor_slope_rad;
  if (!slope.isZero(0.0)) pull = now.heading.back(-weight_N * slope);
  if (uneven_) pull += (robot_.m_t + robot_.m_b) * now.heading.back(ground_.pull_W_m_s2());
  if (common_.rolling_resistance != 0.0) {
    const Vec2 v = ball_velocity(robot_.r, now.motion.phi_dot_star);
    pull -= common_.rolling_resistance * weight_N * v / std::max(v.norm(), kRollingStart_m_s);
  }
  return pull;
}

double MbbrWorld::viscous_N_m_s() const noexcept {
  return common_.friction ? robot_.mu_v + world_.extra_viscous_N_m_s : 0.0;
}

void MbbrWorld::push_and_pull(Instant* now, const Vec2& push_W) const noexcept {
  if (!push_W.isZero(0.0)) {
    now->loads.push_B = now->motion.R().topRows<2>().transpose() * now->heading.back(push_W);
  }
  now->loads.pull_star = pull_star(*now);
}

void MbbrWorld::rolling(Instant* now, const Vec2& push_W, const Vec3& friction_B) const noexcept {
  now->driven(drive_, motors_, viscous_N_m_s(), friction_B);
  push_and_pull(now, push_W);
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
  if (!common_.friction) return Vec3::Zero();
  return friction_limit_N_m(world_, robot_.mu_c * common_.friction_now(time_s_), now.relative_B);
}

/// Per axis, the constant torque that would end this step at rest, limited to friction's: sticking and
/// sliding in one rule.
Vec3 MbbrWorld::coulomb_torque_B(const Instant& free) const noexcept {
  if (!common_.friction) return Vec3::Zero();
  const double h = common_.step_s;
  return uncoupled_coulomb_torque(free.relative_after(h), mobility_, h, friction_limit_B(free));
}

void MbbrWorld::slip_forces(Instant* now, const Vec2& push_W, const MbbrFriction& f) const noexcept {
  push_and_pull(now, push_W);
  if (drive_.slips()) {
    const Vec3 beyond_B = f.axes_B - drive_.share_beyond() * viscous_N_m_s() * now->relative_B;
    now->loads.tau_B = drive_.on_ball_B(f.wheels) + beyond_B;
  } else {
    now->driven(drive_, motors_, viscous_N_m_s(), f.axes_B);
  }
}

/// What contacts, gears and axes carry in this step where they may give way.
MbbrFriction MbbrWorld::slip_friction(const Vec2& push_W, double h) const noexcept {
  Instant free(here_);
  slip_forces(&free, push_W, {});
  const auto mass = loose_.mass(free.motion);
  const MbbrSlipAccelerations a = loose_.accelerations(free.motion, mass, free.loads, {});
  const State next = s_ + h * slip_derivative(s_, free, a);
  Vec<6> rates;
  rates << near(next).relative_B, next.segment<3>(kSlip);
  const double coulomb =
      common_.friction ? robot_.mu_c * world_.coulomb_scale * common_.friction_now(time_s_) : 0.0;
  return loose_.friction(free.motion, mass, rates, h, drive_.share_beyond() * friction_limit_B(free),
                         drive_.rotors(motors_, rotor_rad_s_, coulomb, common_.stiction, viscous_N_m_s(), h),
                         needed(free, felt_as_rolling(a, robot_.r)).normal_N);
}

/// While everything rolls: does it stay so?
bool MbbrWorld::contacts_hold(const Instant& now, const Vec3& friction_B) const noexcept {
  const Vec2& ball = now.a.phi_ddot_inertial;
  const Vec3 relative = now.motion.R().topRows<2>().transpose() * ball - now.a.omega_dot_B;
  return floor_.carries(needed(now, now.a)) &&
         drive_.carries(now.wheel_torque, now.viscous_B + friction_B, relative);
}

/// What the floor must carry; one that lifts the robot carries more.
MbbrFloorForce MbbrWorld::needed(const Instant& now, const MbbrAccelerations& a) const noexcept {
  MbbrFloorForce f = floor_.needed(now.motion, now.loads, a);
  f.normal_N += (robot_.m_t + robot_.m_b) * ground_.lift_m_s2();
  return f;
}

Felt MbbrWorld::felt(const MbbrMotion& m, const MbbrAccelerations& a) const noexcept {
  Felt felt;
  felt.time_s = time_s_;
  felt.omega_B_rad_s = m.omega_B;
  felt.specific_force_B_m_s2 =
      -dynamics_.accelerometer_B(m, a) + ground_.lift_m_s2() * m.R().row(2).transpose();
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

void MbbrWorld::load_wheels(const Instant& now, const MbbrAccelerations& a,
                            const Vec3& contact_torques) noexcept {
  if (!drive_.slips()) return;
  const Vec3 force_B = -robot_.m_t * dynamics_.accelerometer_B(now.motion, a, Vec3(0.0, 0.0, robot_.l));
  drive_.carry(force_B - now.loads.push_B, contact_torques);
}

Vec3 MbbrWorld::wheel_slip_rad_s() const noexcept {
  if (!slipping_ || !drive_.slips()) return Vec3::Zero();
  return rotor_rad_s_ - drive_.wheel_rates(here_.relative_B);
}

MbbrSlipAccelerations MbbrWorld::slip_accelerations(const Here& here, const Vec2& push_W) const noexcept {
  Instant now(here);
  slip_forces(&now, push_W, friction_);
  return loose_.accelerations(now.motion, loose_.mass(now.motion), now.loads, friction_.floor);
}

void MbbrWorld::step(double h) noexcept {
  if (uneven_) {
    const Vec2 slip = s_.segment<2>(kSlip);
    ground_.begin_step(ball_velocity(robot_.r, Vec2(s_.segment<2>(kPhi))),
                       here_.heading(Vec2(ball_velocity(robot_.r, here_.motion.phi_dot_star) + slip)), h);
  }
  drive_.begin_step(motors_, here_.relative_B, kinematics_.wheels_from_ball(s_.segment<3>(kRelative)), h);
  const Vec2 push = push_now();
  if (!slipping_ && roll(push, h)) return;
  slip(push, h);
}

/// A step without slip; false, and nothing done, if the contacts do not carry it.
bool MbbrWorld::roll(const Vec2& push, double h) noexcept {
  Instant free(here_);
  rolling(&free, push, Vec3::Zero());
  friction_.axes_B = coulomb_torque_B(free);
  const Instant now = free.with_friction(dynamics_, drive_, friction_.axes_B);
  if (limited_ && !contacts_hold(now, friction_.axes_B)) return false;
  if (sensors_.aged()) sensors_.feel(felt(now.motion, now.a));
  load_wheels(now, now.a, drive_.contact_torques(now.wheel_torque, now.viscous_B + friction_.axes_B));
  arrive(rk4_step(s_, now.derivative(drive_), h, [&](const State& s) {
    Instant then(near(s));
    rolling(&then, push, friction_.axes_B);
    return then.derivative(drive_);
  }));
  time_s_ += h;
  return true;
}

void MbbrWorld::slip(const Vec2& push, double h) noexcept {
  if (!slipping_) rotor_rad_s_ = drive_.wheel_rates(here_.relative_B);
  slipping_ = true;
  friction_ = slip_friction(push, h);
  const MbbrSlipAccelerations a = slip_accelerations(here_, push);
  const MbbrAccelerations felt_a = felt_as_rolling(a, robot_.r);
  Instant now(here_);
  push_and_pull(&now, push);
  if (sensors_.aged()) sensors_.feel(felt(now.motion, felt_a));
  load_wheels(now, felt_a, friction_.wheels);
  const Vec3 before = wheel_slip_rad_s();
  State next = rk4_step(s_, slip_derivative(s_, here_, a), h, [&](const State& s) {
    const Here then = near(s);
    return slip_derivative(s, then, slip_accelerations(then, push));
  });
  rotor_rad_s_ = friction_.rotor_rad_s;
  if (friction_.holds) next.segment<3>(kSlip).setZero();
  arrive(next);
  drive_.slip_by(0.5 * h * (before + wheel_slip_rad_s()));
  slipping_ = !friction_.holds;
  time_s_ += h;
}

void MbbrWorld::end_tick() noexcept {
  if (!held_) {
    disturb();
    here_ = Here(s_);  // anew once a tick: what a step adds is exact but for the last digit
  }
  motors_.update_battery(kinematics_.wheels_from_ball(here_.relative_B));
}

Felt MbbrWorld::felt_now() const noexcept {
  if (slipping_) {
    return felt(here_.motion, felt_as_rolling(slip_accelerations(here_, push_now()), robot_.r));
  }
  Instant now(here_);
  rolling(&now, push_now(), Vec3::Zero());
  if (!held_) now = now.with_friction(dynamics_, drive_, coulomb_torque_B(now));
  return felt(now.motion, now.a);
}

RawSample MbbrWorld::sense() {
  TrueMotion now{felt_now(), s_.segment<3>(kTheta), motors_.battery_V()};
  if (held_) {
    now.specific_force_B_m_s2 =
        rotation(quaternion_of(now.theta_rad)).transpose() * Vec3(0.0, 0.0, kGravity_m_s2);
  }
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
