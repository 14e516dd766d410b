#include "robots/mip/world.hpp"

#include <algorithm>

#include "equipoise/plant/coulomb.hpp"
#include "equipoise/plant/integrator.hpp"

namespace equipoise {
namespace {

constexpr double kRollingStart_m_s = 0.005;  // below it rolling resistance fades

enum : int { kTheta, kPhi, kPsi, kThetaDot, kPhiDot, kPsiDot, kPosition };  // in the state

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
  p.d *= actual.track;
  const double square = actual.wheel_radius * actual.wheel_radius;  // the same mass on a larger wheel
  p.I_w1 *= square;
  p.I_w2 *= square;
  p.I_w3 *= square;
  return p;
}

Mat<2, 2> wheel_mobility(const MipParameters& robot) noexcept {
  const MipDynamics dynamics(robot);
  const MipKinematics kinematics(robot);
  Mat<2, 2> mobility;
  for (int i = 0; i < 2; ++i) {
    const Vec2 unit = Vec2::Unit(i);
    const Vec3 a = dynamics.accelerations(MipMotion{}, unit.sum(), unit.x() - unit.y());
    mobility.col(i) = kinematics.wheels(a(1), a(2));
  }
  return mobility;
}

MipWorld::MipWorld(const MipParameters& robot, const MotorParameters& motor, const Calibration& calibration,
                   const MipWorldParams& world)
    : TickedWorld(motor, calibration, world.common),
      robot_(as_built(robot, world.common.actual)),
      world_(world),
      kinematics_(robot_),
      dynamics_(robot_),
      ground_{Ground(world.common.floor, robot_.r, world.common.seed),
              Ground(world.common.floor, robot_.r, world.common.seed)},
      mobility_(wheel_mobility(robot_)),
      s_(start_state(start_noise_, world.common.initial_tilt_rad)),
      sensors_(calibration, world.common, Mip::kWheels, start_noise_, Vec3(s_(kTheta), 0.0, s_(kPsi))),
      uneven_(world.common.floor.uneven()) {}

MipWorld::Facing MipWorld::facing(const State& s) noexcept { return {Turn(s(kTheta)), Turn(s(kPsi))}; }

Vec2 MipWorld::wheel_rates(const State& s) const noexcept {
  return kinematics_.wheels(s(kPhiDot), s(kPsiDot));
}

double MipWorld::speed(const State& s) const noexcept {
  return lifted() ? 0.0 : -robot_.r * (s(kPhiDot) + s(kThetaDot));
}

/// Motor and viscous friction, as far as the teeth touch.
Vec2 MipWorld::gear_torque(const Vec2& wheel_rates) const noexcept {
  const double viscous = common_.friction ? robot_.mu_v : 0.0;
  const Vec2 motor = motors_.torque(wheel_rates).cwiseProduct(world_.drivetrain.motor_gain);
  return (motor - viscous * wheel_rates).cwiseProduct(engaged_);
}

/// Coulomb friction of each wheel over a whole step from here.
Vec2 MipWorld::friction_torque(const Facing& facing, const Vec2& gear_torque) const noexcept {
  if (!common_.friction) return Vec2::Zero();
  const State next = s_ + common_.step_s * derivative(s_, facing, accelerations(s_, facing, gear_torque));
  const Vec2 rates = wheel_rates(s_);
  Vec2 limit = common_.friction_now(time_s_) * (robot_.mu_c * world_.drivetrain.friction_gain);
  for (int i = 0; i < Mip::kWheels; ++i) limit(i) *= common_.stiction.factor(rates(i));
  return coulomb_torque(wheel_rates(next), mobility_, common_.step_s, limit);
}

Vec3 MipWorld::accelerations(const State& s, const Facing& facing, const Vec2& wheel_torque) const noexcept {
  if (lifted()) {  // the body is in a hand, the wheels are in the air
    const Vec2 wheel = wheel_torque / (robot_.I_w1 + robot_.I_r);
    return {0.0, kinematics_.phi(wheel), 0.0};
  }
  Vec3 a = dynamics_.accelerations({s(kTheta), s(kThetaDot), s(kPhiDot), s(kPsiDot)}, facing.tilt,
                                   wheel_torque.x() + wheel_torque.y(), wheel_torque.x() - wheel_torque.y());
  const Vec2 push_W = push_force_W(common_, time_s_);
  const Vec2& slope = common_.floor_slope_rad;
  const double resistance = common_.rolling_resistance;
  if (!push_W.isZero(0.0) || !slope.isZero(0.0) || resistance != 0.0 || uneven_) {
    // Force along the rolling direction at the centre of mass: power F (r (phi' + theta') + l cos theta'),
    // with the axle's speed along -y. On a slope the whole weight pulls the axle downhill.
    const Vec2 weight_W = -weight_kg() * kGravity_m_s2 * slope;
    const double forward = -facing.heading.back(push_W).y();
    const double speed = robot_.r * (s(kPhiDot) + s(kThetaDot));  // along the rolling direction
    const double weight_N = weight_kg() * kGravity_m_s2;
    const double held_back = resistance * weight_N * speed / std::max(std::abs(speed), kRollingStart_m_s);
    const double downhill = -facing.heading.back(weight_W).y() - held_back + ground_N_(0);
    const double c = facing.tilt.cosine();
    const double lm = robot_.l * robot_.m_b;
    const double wheels = 2.0 * robot_.I_w1 + (robot_.m_b + 2.0 * robot_.m_w) * robot_.r * robot_.r;
    const double m22 = wheels + 2.0 * robot_.I_r;
    const double m12 = wheels + lm * robot_.r * c;
    const double m11 = robot_.I_b1 + robot_.l * lm + 2.0 * lm * robot_.r * c + wheels;
    const double det = m11 * m22 - m12 * m12;
    const double f1 = forward * (robot_.r + robot_.l * c) + downhill * robot_.r;
    const double f2 = (forward + downhill) * robot_.r;
    a(0) += (m22 * f1 - m12 * f2) / det;
    a(1) += (m11 * f2 - m12 * f1) / det;
    // The first wheel, at +x, pushed along -y turns the robot back.
    a(2) -= 0.5 * robot_.d * ground_N_(1) / dynamics_.yaw_inertia(facing.tilt.sine());
  }
  return a;
}

MipWorld::State MipWorld::derivative(const State& s, const Facing& facing,
                                     const Vec3& accelerations) const noexcept {
  State d;
  d.segment<3>(kTheta) = s.segment<3>(kThetaDot);
  d.segment<3>(kThetaDot) = accelerations;
  d.segment<2>(kPosition) = facing.heading(Vec2(0.0, speed(s)));
  return d;
}

/// Each wheel carries half the weight over the floor where it is.
void MipWorld::feel_ground(double h) noexcept {
  const Turn heading(s_(kPsi));
  Vec2 forward_N;
  for (int i = 0; i < Mip::kWheels; ++i) {
    const double side = i == 0 ? 0.5 * robot_.d : -0.5 * robot_.d;
    Ground& ground = ground_[static_cast<std::size_t>(i)];
    ground.begin_step(s_.segment<2>(kPosition) + heading(Vec2(side, 0.0)),
                      heading(Vec2(0.0, speed(s_) + side * s_(kPsiDot))), h);
    forward_N(i) = -0.5 * weight_kg() * heading.back(ground.pull_W_m_s2()).y();
  }
  ground_N_ = Vec2(forward_N.sum(), forward_N(0) - forward_N(1));
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
    felt.specific_force_B_m_s2 = -dynamics_.accelerometer_B(
        {s_(kTheta), s_(kThetaDot), s_(kPhiDot), s_(kPsiDot)}, accelerations, from_com);
  }
  const double lift = 0.5 * (ground_[0].lift_m_s2() + ground_[1].lift_m_s2());
  felt.specific_force_B_m_s2 += lift * Vec3(0.0, sin, cos);
  felt.wheel_angle_rad.head<2>() =
      kinematics_.wheels(s_(kPhi), s_(kPsi)) + Vec2(gears_[0].ahead_rad(), gears_[1].ahead_rad());
  return felt;
}

/// A step or, where the PWM changes within it, a part of one: friction is that of the whole.
void MipWorld::step(double h) noexcept {
  if (lifted()) {
    s_(kThetaDot) = s_(kTheta) < kHeldTilt_rad ? kHandRate_rad_s : 0.0;
    s_(kPsiDot) = 0.0;
  }
  if (uneven_) feel_ground(h);
  const Facing here = facing(s_);
  const Vec2 rates = wheel_rates(s_);
  const Vec2 crossing = motors_.torque(rates + Vec2(gears_[0].rate_rad_s(), gears_[1].rate_rad_s()));
  for (std::size_t i = 0; i < gears_.size(); ++i)  // the motor's side of each gear
    engaged_(static_cast<int>(i)) =
        gears_[i].step(world_.drivetrain.gear, crossing(static_cast<int>(i)), h) ? 1.0 : 0.0;
  const Vec2 gear = gear_torque(rates);
  const Vec2 friction = friction_torque(here, gear);
  const Vec3 now = accelerations(s_, here, gear + friction);
  if (sensors_.aged()) sensors_.feel(felt(now));
  s_ = rk4_step(s_, derivative(s_, here, now), h, [&](const State& s) {
    const Facing then{here.tilt.near(s(kTheta), s(kTheta) - s_(kTheta)),
                      here.heading.near(s(kPsi), s(kPsi) - s_(kPsi))};
    return derivative(s, then, accelerations(s, then, gear_torque(wheel_rates(s)) + friction));
  });
  time_s_ += h;
}

void MipWorld::end_tick() noexcept {
  if (!held_) disturb();
  motors_.update_battery(wheel_rates(s_));
}

RawSample MipWorld::sense() {
  const Facing here = facing(s_);
  const Vec2 gear = gear_torque(wheel_rates(s_));
  const Vec3 now = accelerations(s_, here, gear + friction_torque(here, gear));
  return sensors_.sense({felt(now), Vec3(s_(kTheta), 0.0, s_(kPsi)), motors_.battery_V()});
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
