#include "robots/mip/world.hpp"

#include <algorithm>

#include "equipoise/plant/coulomb.hpp"
#include "equipoise/plant/integrator.hpp"

namespace equipoise {
namespace {

constexpr double kRollingStart_m_s = 0.005;  // below it rolling resistance fades

enum At : int { kTheta, kPhi, kPsi, kThetaDot, kPhiDot, kPsiDot, kPosition };

// A hand that lifts the robot tips it slowly, our estimate.
constexpr double kHandRate_rad_s = 0.1;
constexpr double kHeldTilt_rad = 0.3;

Vec<8> start_state(NoiseStream& noise, double sigma) {
  Vec<8> s = Vec<8>::Zero();
  s(kTheta) = noise.gaussian(sigma);
  s(kPsi) = noise.gaussian(sigma);
  return s;
}

}  // namespace

MipParameters as_built(MipParameters p, const ActualScales& actual) noexcept {
  p.m_b *= actual.body_mass;
  p.l *= actual.com_height;
  p.I_b1 *= actual.body_inertia;
  p.I_b2 *= actual.body_inertia;
  p.I_b3 *= actual.body_inertia;
  p.r *= actual.wheel_radius;
  const double square = actual.wheel_radius * actual.wheel_radius;  // the same mass on a larger wheel
  p.I_w1 *= square;
  p.I_w2 *= square;
  p.I_w3 *= square;
  return p;
}

MipWorld::MipWorld(const MipParameters& robot, const MotorParameters& motor, const Calibration& calibration,
                   const MipWorldParams& world)
    : robot_(as_built(robot, world.common.actual)),
      world_(world),
      kinematics_(robot_),
      dynamics_(robot_),
      motors_(motor, calibration, world.common),
      start_noise_(world.common.seed, kStartNoise),
      process_noise_(world.common.seed, kProcessNoise),
      s_(start_state(start_noise_, world.common.initial_tilt_rad)),
      sensors_(calibration, world.common, Mip::kWheels, start_noise_, Vec3(s_(kTheta), 0.0, s_(kPsi))) {
  for (int i = 0; i < 2; ++i) {  // upright at rest
    const Vec2 unit = Vec2::Unit(i);
    const Vec3 a = dynamics_.accelerations(MipMotion{}, unit.sum(), unit.x() - unit.y());
    mobility_.col(i) = kinematics_.wheels(a(1), a(2));
  }
}

MipMotion MipWorld::motion(const State& s) noexcept {
  return {s(kTheta), s(kThetaDot), s(kPhiDot), s(kPsiDot)};
}

MipWorld::Facing::Facing(const State& s) noexcept : tilt(s(kTheta)), heading(s(kPsi)) {}

MipWorld::Facing::Facing(const Facing& before, const State& s, const State& from) noexcept
    : tilt(before.tilt.near(s(kTheta), s(kTheta) - from(kTheta))),
      heading(before.heading.near(s(kPsi), s(kPsi) - from(kPsi))) {}

Vec2 MipWorld::wheel_rates(const State& s) const noexcept {
  return kinematics_.wheels(s(kPhiDot), s(kPsiDot));
}

/// Motor and viscous friction, as far as the teeth touch.
Vec2 MipWorld::gear_torque(const State& s) const noexcept {
  const Vec2 rate = wheel_rates(s);
  Vec2 tau = motors_.torque(rate).cwiseProduct(world_.drivetrain.motor_gain);
  if (world_.common.friction) tau -= robot_.mu_v * rate;
  return tau.cwiseProduct(engaged_);
}

Vec3 MipWorld::accelerations(const State& s, const Facing& facing, const Vec2& wheel_torque) const noexcept {
  if (lifted()) {  // the body is in a hand, the wheels are in the air
    const Vec2 wheel = wheel_torque / robot_.I_w1;
    return {0.0, kinematics_.phi(wheel), 0.0};
  }
  Vec3 a = dynamics_.accelerations(motion(s), facing.tilt, wheel_torque.sum(),
                                   wheel_torque.x() - wheel_torque.y());
  const Vec2 push_W = push_force_W(world_.common, time_s_);
  const Vec2& slope = world_.common.floor_slope_rad;
  const double resistance = world_.common.rolling_resistance;
  if (!push_W.isZero(0.0) || !slope.isZero(0.0) || resistance != 0.0) {
    // Force along the rolling direction at the centre of mass: power F (r (phi' + theta') + l cos theta'),
    // with the axle's speed along -y. On a slope the whole weight pulls the axle downhill.
    const Vec2 weight_W = -(robot_.m_b + 2.0 * robot_.m_w) * kGravity_m_s2 * slope;
    const double forward = -facing.heading.back(push_W).y();
    const double speed = robot_.r * (s(kPhiDot) + s(kThetaDot));  // along the rolling direction
    const double weight_N = (robot_.m_b + 2.0 * robot_.m_w) * kGravity_m_s2;
    const double held_back = resistance * weight_N * speed / std::max(std::abs(speed), kRollingStart_m_s);
    const double downhill = -facing.heading.back(weight_W).y() - held_back;
    const double c = facing.tilt.cosine();
    const double lm = robot_.l * robot_.m_b;
    const double m22 = 2.0 * robot_.I_w1 + (robot_.m_b + 2.0 * robot_.m_w) * robot_.r * robot_.r;
    const double m12 = m22 + lm * robot_.r * c;
    const double m11 = robot_.I_b1 + robot_.l * lm + 2.0 * lm * robot_.r * c + m22;
    const double det = m11 * m22 - m12 * m12;
    const double f1 = forward * (robot_.r + robot_.l * c) + downhill * robot_.r;
    const double f2 = (forward + downhill) * robot_.r;
    a(0) += (m22 * f1 - m12 * f2) / det;
    a(1) += (m11 * f2 - m12 * f1) / det;
  }
  return a;
}

MipWorld::State MipWorld::derivative(const State& s, const Facing& facing,
                                     const Vec3& accelerations) const noexcept {
  State d;
  d.segment<3>(kTheta) = s.segment<3>(kThetaDot);
  d.segment<3>(kThetaDot) = accelerations;
  const double speed = lifted() ? 0.0 : -robot_.r * (s(kPhiDot) + s(kThetaDot));
  d.segment<2>(kPosition) = facing.heading(Vec2(0.0, speed));
  return d;
}

Vec2 MipWorld::friction_torque(const State& s, const Facing& facing, const Vec2& gear_torque) const noexcept {
  if (!world_.common.friction) return Vec2::Zero();
  const double h = world_.common.step_s;
  const State next = s + h * derivative(s, facing, accelerations(s, facing, gear_torque));
  const Vec2 now = wheel_rates(s);
  const Stiction& stiction = world_.common.stiction;
  Vec2 limit = robot_.mu_c * world_.drivetrain.friction_gain;
  limit = limit.cwiseProduct(Vec2(stiction.factor(now.x()), stiction.factor(now.y())));
  return coulomb_torque<2>(wheel_rates(next), mobility_, h, limit);
}

/// The motor's side of each gear over one step.
void MipWorld::cross_backlash(double step_s) noexcept {
  const GearPlayParams& gear = world_.drivetrain.gear;
  if (gear.play_rad == 0.0) return;
  const Vec2 rate(gears_[0].rate_rad_s(), gears_[1].rate_rad_s());
  const Vec2 motor = motors_.torque(wheel_rates(s_) + rate);
  for (int i = 0; i < 2; ++i) {
    const bool touch = gears_[static_cast<std::size_t>(i)].step(gear, motor(i), step_s);
    engaged_(i) = touch ? 1.0 : 0.0;
  }
}

void MipWorld::disturb() {
  if (world_.process_noise_sigma.isZero(0.0)) return;
  for (int i = 0; i < 6; ++i) s_(i) += process_noise_.gaussian(world_.process_noise_sigma(i));
}

Felt MipWorld::felt(const Vec3& accelerations) const noexcept {
  const double sin = std::sin(s_(kTheta));
  const double cos = std::cos(s_(kTheta));
  Felt felt;
  felt.time_s = time_s_;
  felt.omega_B_rad_s << s_(kThetaDot), sin * s_(kPsiDot), cos * s_(kPsiDot);
  if (held_ || lifted()) {
    felt.specific_force_B_m_s2 << 0.0, sin * kGravity_m_s2, cos * kGravity_m_s2;
  } else {
    const Vec3 from_com = robot_.l_a - Vec3(0.0, 0.0, robot_.l);
    felt.specific_force_B_m_s2 = -dynamics_.accelerometer_B(motion(s_), accelerations, from_com);
  }
  felt.wheel_angle_rad.head<2>() =
      kinematics_.wheels(s_(kPhi), s_(kPsi)) + Vec2(gears_[0].ahead_rad(), gears_[1].ahead_rad());
  return felt;
}

void MipWorld::step(double h) noexcept {
  if (lifted()) {
    s_(kThetaDot) = s_(kTheta) < kHeldTilt_rad ? kHandRate_rad_s : 0.0;
    s_(kPsiDot) = 0.0;
  }
  cross_backlash(h);
  const Vec2 gear = gear_torque(s_);
  const Facing facing(s_);
  const Vec2 friction = friction_torque(s_, facing, gear);
  const Vec3 now = accelerations(s_, facing, gear + friction);
  if (sensors_.aged()) sensors_.feel(felt(now));
  s_ = rk4_step(s_, derivative(s_, facing, now), h, [&](const State& s) {
    const Facing turned(facing, s, s_);
    return derivative(s, turned, accelerations(s, turned, gear_torque(s) + friction));
  });
  time_s_ += h;
}

void MipWorld::advance(const MotorCommand& command) {
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
  motors_.update_battery(wheel_rates(s_));
}

RawSample MipWorld::sense() {
  const Vec2 gear = gear_torque(s_);
  const Facing facing(s_);
  const Felt here = felt(accelerations(s_, facing, gear + friction_torque(s_, facing, gear)));
  TrueMotion m;
  m.time_s = time_s_;
  m.theta_rad << s_(kTheta), 0.0, s_(kPsi);
  m.omega_B_rad_s = here.omega_B_rad_s;
  m.specific_force_B_m_s2 = here.specific_force_B_m_s2;
  m.wheel_angle_rad = {here.wheel_angle_rad(0), here.wheel_angle_rad(1)};
  m.battery_V = motors_.battery_V();
  return sensors_.sense(m);
}

MipEstimate MipWorld::truth() const noexcept {
  MipEstimate x;
  x.theta = s_(kTheta);
  x.phi = s_(kPhi);
  x.psi = s_(kPsi);
  x.theta_dot = s_(kThetaDot);
  x.phi_dot = s_(kPhiDot);
  x.psi_dot = s_(kPsiDot);
  x.position_W_m = s_.segment<2>(kPosition);
  return x;
}

}  // namespace equipoise
