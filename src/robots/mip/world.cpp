#include "robots/mip/world.hpp"

#include <algorithm>

namespace equipoise {
namespace {

constexpr double kRollingStart_m_s = 0.005;  // below it rolling resistance fades

using namespace mip_at;  // NOLINT(google-build-using-namespace): the places in the state

// A hand that lifts the robot tips it slowly, our estimate.
constexpr double kHandRate_rad_s = 0.1;
constexpr double kHeldTilt_rad = 0.3;

MipRollingOf<double> start(const MipParameters& robot, const MipWorldParams& world, NoiseStream& noise) {
  MipRollingOf<double> now{};
  now.state[kTheta] = noise.gaussian(world.common.initial_tilt_rad);
  now.state[kPsi] = noise.gaussian(world.common.initial_tilt_rad);
  now.bodies = bodies(robot);
  now.yaw_to_wheel = robot.yaw_to_wheel();
  now.viscous_N_m_s = world.common.friction ? robot.mu_v : 0.0;
  for (int i = 0; i < 2; ++i) {
    now.coulomb_N_m[i] = world.common.friction ? robot.mu_c * world.drivetrain.friction_gain(i) : 0.0;
    now.motor_gain[i] = world.drivetrain.motor_gain(i);
    now.engaged[i] = 1.0;
  }
  now.gear = world.drivetrain.gear;
  return now;
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
      now_(start(robot_, world, start_noise_)),
      sensors_(calibration, world.common, Mip::kWheels, start_noise_, Vec3(s()(kTheta), 0.0, s()(kPsi))),
      uneven_(world.common.floor.uneven()),
      plain_(world.common.plain() && world.lift_at_s < 0.0) {
  Eigen::Map<Mat<2, 2>>(now_.mobility) = wheel_mobility(robot_);
}

Vec3 MipWorld::accelerations(const State& s, const Facing& facing, const Vec2& wheel_torque) const noexcept {
  if (lifted()) {  // the body is in a hand, the wheels are in the air
    const Vec2 wheel = wheel_torque / (robot_.I_w1 + robot_.I_r);
    return {0.0, kinematics_.phi(wheel), 0.0};
  }
  Vec3 a = MipLevelOf<double>{dynamics_}.accelerations(s, facing, wheel_torque);
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

Vec2 MipWorld::friction_limit(const Vec2& wheel_rates) const noexcept {
  const Stiction& stiction = common_.stiction;
  const double scale = common_.friction_now(time_s_);
  return {scale * now_.coulomb_N_m[0] * stiction.factor(wheel_rates.x()),
          scale * now_.coulomb_N_m[1] * stiction.factor(wheel_rates.y())};
}

/// Each wheel carries half the weight over the floor where it is.
void MipWorld::feel_ground(double h) noexcept {
  const Turn heading(s()(kPsi));
  const double speed =
      lifted() ? 0.0 : -robot_.r * (s()(kPhiDot) + s()(kThetaDot));  // along the yaw frame's y
  Vec2 forward_N;
  for (int i = 0; i < Mip::kWheels; ++i) {
    const double side = i == 0 ? 0.5 * robot_.d : -0.5 * robot_.d;
    Ground& ground = ground_[static_cast<std::size_t>(i)];
    ground.begin_step(s().segment<2>(kPosition) + heading(Vec2(side, 0.0)),
                      heading(Vec2(0.0, speed + side * s()(kPsiDot))), h);
    forward_N(i) = -0.5 * weight_kg() * heading.back(ground.pull_W_m_s2()).y();
  }
  ground_N_ = Vec2(forward_N.sum(), forward_N(0) - forward_N(1));
}

void MipWorld::disturb() {
  if (world_.process_noise_sigma.isZero(0.0)) return;
  for (int i = 0; i < 6; ++i) now_.state[i] += process_noise_.gaussian(world_.process_noise_sigma(i));
}

Felt MipWorld::felt(const Vec3& accelerations) const noexcept {
  const double sin = std::sin(s()(kTheta));
  const double cos = std::cos(s()(kTheta));
  Felt felt;
  felt.time_s = time_s_;
  felt.omega_B_rad_s << s()(kThetaDot), sin * s()(kPsiDot), cos * s()(kPsiDot);
  if (held_ || lifted()) {
    felt.specific_force_B_m_s2 << 0.0, sin * kGravity_m_s2, cos * kGravity_m_s2;
  } else {
    const Vec3 from_com = robot_.l_a - Vec3(0.0, 0.0, robot_.l);
    felt.specific_force_B_m_s2 = -dynamics_.accelerometer_B(
        {s()(kTheta), s()(kThetaDot), s()(kPhiDot), s()(kPsiDot)}, accelerations, from_com);
  }
  const double lift = 0.5 * (ground_[0].lift_m_s2() + ground_[1].lift_m_s2());
  felt.specific_force_B_m_s2 += lift * Vec3(0.0, sin, cos);
  felt.wheel_angle_rad.head<2>() =
      kinematics_.wheels(s()(kPhi), s()(kPsi)) + Vec2(now_.gears[0].ahead_rad(), now_.gears[1].ahead_rad());
  return felt;
}

void MipWorld::step(double h) noexcept {
  if (lifted()) {
    now_.state[kThetaDot] = now_.state[kTheta] < kHeldTilt_rad ? kHandRate_rad_s : 0.0;
    now_.state[kPsiDot] = 0.0;
  }
  if (uneven_) feel_ground(h);
  equipoise::step(
      &now_, Body{*this}, Facing(s()), common_.step_s, h,
      [this](const Vec2& rates) { return motors_.torque(rates); },
      [this](const Vec2& rates) { return friction_limit(rates); },
      [this](const Vec3& accelerations) {
        if (sensors_.aged()) sensors_.feel(felt(accelerations));
      });
  time_s_ += h;
}

void MipWorld::end_tick() noexcept {
  if (!held_) disturb();
  motors_.update_battery(now_.wheel_rates(s()));
}

bool MipWorld::begin_rolling(const MotorCommand& command, Rolling* robot) noexcept {
  if (!plain_ || !command.enable) return false;
  held_ = false;
  motors_.command(command);
  *robot = now_;
  robot->bridges = *motors_.bridges();
  return true;
}

void MipWorld::end_rolling(const Rolling& robot) noexcept {
  now_ = robot;
  for (int i = 0; i < steps_per_tick(); ++i) time_s_ += common_.step_s;
  end_tick();
}

RawSample MipWorld::sense() {
  const State at = s();
  const Vec2 rates = now_.wheel_rates(at);
  const Vec2 gear = now_.gear_torque(rates, motors_.torque(rates));
  const Facing facing(at);
  const Vec2 friction =
      friction_torque<double>(now_, Body{*this}, at, facing, gear, friction_limit(rates), common_.step_s);
  return sensors_.sense({felt(accelerations(at, facing, gear + friction)), Vec3(s()(kTheta), 0.0, s()(kPsi)),
                         motors_.battery_V()});
}

MipEstimate MipWorld::truth() const noexcept {
  MipEstimate x;
  x.theta = s()(kTheta);
  x.phi = s()(kPhi);
  x.psi = s()(kPsi);
  x.theta_dot = s()(kThetaDot);
  x.phi_dot = s()(kPhiDot);
  x.psi_dot = s()(kPsiDot);
  x.position_W_m = s().segment<2>(kPosition);
  return x;
}

}  // namespace equipoise
