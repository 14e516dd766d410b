// Effects of drive, floor, noise and battery, each alone and against its formula.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "robots/mbbr/world.hpp"
#include "robots/mip/world.hpp"
#include "support/assign.hpp"

namespace equipoise {
namespace {

template <class Params>
Params quiet() {
  Params w;
  w.common.initial_tilt_rad = 0.0;
  w.common.friction = false;
  w.common.battery_V = MotorParameters().nominal_V;
  return w;
}

/// Motors whose torque follows the duty at any speed.
template <class Params>
Params without_back_emf() {
  Params w = quiet<Params>();
  w.common.actual.back_emf = 1e-9;
  return w;
}

MotorParameters linear() {
  MotorParameters m;
  m.bridge = BridgeType::kDriveBrake;
  return m;
}

MotorCommand with(const Vec3& duty) {
  MotorCommand on{};
  on.enable = true;
  for (int i = 0; i < 3; ++i) on.duty[i] = duty(i);
  return on;
}

MbbrWorld run(const MbbrWorldParams& w, const Vec3& duty, int ticks) {
  MbbrWorld world(MbbrParameters(), linear(), Calibration(), w);
  for (int i = 0; i < ticks; ++i) world.advance(with(duty));
  return world;
}

MipWorld run(const MipWorldParams& w, const Vec2& duty, int ticks, const MipParameters& robot = {}) {
  MipWorld world(robot, linear(), Calibration(), w);
  for (int i = 0; i < ticks; ++i) world.advance(with(Vec3(duty.x(), duty.y(), 0.0)));
  return world;
}

Vec<6> rates(const MipWorld& world) {
  const MipEstimate x = world.truth();
  return (Vec<6>() << x.theta, x.phi, x.psi, x.theta_dot, x.phi_dot, x.psi_dot).finished();
}

TEST(Friction, ASpinEndsWhereMotorsMeetCoulombAndViscousFriction) {
  const MbbrParameters robot;
  const double ratio = robot.r / robot.r_w;
  const auto ends_at = [&](double coulomb_scale, double viscous) {
    MbbrWorldParams w = quiet<MbbrWorldParams>();
    w.common.friction = true;
    w.coulomb_scale = coulomb_scale;
    w.extra_viscous_N_m_s = viscous;
    return std::abs(run(w, Vec3::Constant(0.6), 400).truth().omega_B.z());
  };
  for (const double scale : {1.0, 1.5}) {
    for (const double viscous : {0.0, 0.003}) {
      const double torque = ratio * std::sqrt(3.0) * linear().k1() * 0.6 - scale * robot.mu_c;
      const double expected = torque / (ratio * ratio * linear().k2() + robot.mu_v + viscous);
      EXPECT_NEAR(ends_at(scale, viscous), expected, 1e-3 * expected);
    }
  }
}

TEST(TorqueImbalance, IsAsIfTheDutiesDiffered) {
  const Vec3 gain(1.0575, 0.9425, 1.0);
  const Vec3 duty(0.4, -0.5, 0.6);
  MbbrWorldParams w = without_back_emf<MbbrWorldParams>();
  const MbbrEstimate asked = run(w, gain.cwiseProduct(duty), 4).truth();
  w.drive.wheel_torque_scale = gain;
  const MbbrEstimate got = run(w, duty, 4).truth();
  EXPECT_LT((got.omega_B - asked.omega_B).norm() + (got.phi - asked.phi).norm(), 1e-6);

  MipWorldParams m = without_back_emf<MipWorldParams>();
  const Vec<6> both = rates(run(m, Vec2(0.5 * 1.06, 0.4 * 0.94), 4));
  m.drivetrain.motor_gain = Vec2(1.06, 0.94);
  EXPECT_LT((rates(run(m, Vec2(0.5, 0.4), 4)) - both).norm(), 1e-6);
}

TEST(FrictionGain, IsTorqueThatEachMotorLacks) {
  MipParameters robot;
  robot.mu_c = 0.02;
  MipWorldParams w = without_back_emf<MipWorldParams>();
  w.common.friction = true;
  const Vec2 gain(0.9, 1.1);
  const double lacks = robot.mu_c / linear().k1();
  const Vec2 duty(0.5, 0.5);
  const Vec<6> asked = rates(run(w, duty - lacks * (gain - Vec2::Ones()), 3, robot));
  w.drivetrain.friction_gain = gain;
  EXPECT_LT((rates(run(w, duty, 3, robot)) - asked).norm(), 1e-6);
}

TEST(GearPlay, AnEdumipStartsWhenItsMotorsHaveCrossedHalfOfIt) {
  MipWorldParams w = without_back_emf<MipWorldParams>();
  const double free = run(w, Vec2(0.3, 0.3), 1).truth().phi_dot;
  w.drivetrain.gear = {0.02, 2e-5};
  MipWorld world = run(w, Vec2(0.3, 0.3), 1);
  // Steps of 1 ms: rate n a h, angle n (n + 1) / 2 a h^2.
  const double a = 0.3 * linear().k1() / 2e-5;
  int crossing = 0;
  while (0.5 * crossing * (crossing + 1) * a * 1e-6 < 0.01) ++crossing;
  ASSERT_GT(crossing, 1);
  ASSERT_LT(crossing, 5);
  EXPECT_NEAR(world.truth().phi_dot / free, (5.0 - crossing) / 5.0, 0.01);
}

TEST(ActuationLatency, TheTorqueComesSoManyStepsLater) {
  MbbrWorldParams w = without_back_emf<MbbrWorldParams>();
  const double prompt = run(w, Vec3::Constant(0.5), 1).truth().omega_B.z();
  w.common.actuation_latency_steps = 3;  // of five
  EXPECT_NEAR(run(w, Vec3::Constant(0.5), 1).truth().omega_B.z() / prompt, 0.4, 1e-6);
}

TEST(Battery, SagsByItsResistanceTimesTheMotorsCurrent) {
  MbbrWorldParams w = without_back_emf<MbbrWorldParams>();
  w.common.battery_resistance_ohm = 0.15;
  // A bridge draws duty times the motor's current.
  const double current_A = (0.81 + 0.25 + 0.01) * w.common.battery_V / linear().resistance_ohm;
  EXPECT_NEAR(run(w, Vec3(0.9, -0.5, 0.1), 1).battery_V(), w.common.battery_V - 0.15 * current_A, 1e-6);
}

class Drive : public testing::Test {
 protected:
  /// Torque axis of a wheel at this angle, chassis axes.
  static Vec3 axis(const MbbrDriveParams& p, int wheel, double angle_rad) {
    MbbrDrive drive(robot_, p);
    drive.begin_step(still_, Vec3::Zero(), Vec3::Constant(angle_rad), 1e-3);
    return drive.on_ball_B(Vec3::Unit(wheel)) * robot_.r_w / robot_.r;
  }
  inline static const MbbrParameters robot_;
  inline static const MbbrDrive::Motors still_{linear(), Calibration(), WorldParams()};
};

TEST_F(Drive, RollerTiltTurnsEachAxisTowardsTheRowThatCarries) {
  MbbrDriveParams p;
  p.roller_tilt_rad = 0.08;
  const double half_a_roller = 0.5 * kPi / p.rollers_per_turn;
  for (int i = 0; i < 3; ++i) {
    const Vec3 nominal = MbbrKinematics(robot_).T_ob().col(i);
    const Vec3 contact = wheel_contacts(robot_).col(i);
    for (const double row : {1.0, -1.0}) {
      const Vec3 expected = std::cos(0.08) * nominal + row * std::sin(0.08) * contact;
      EXPECT_LT((axis(p, i, row * half_a_roller) - expected).norm(), 1e-12);
    }
  }
}

TEST_F(Drive, WheelsHangOverWithTheMassCentre) {
  MbbrDriveParams p;
  p.com_offset_rad = Vec2(0.03, -0.02);
  const Mat3 hung = turned_by(Vec3(0.03, -0.02, 0.0));
  for (int i = 0; i < 3; ++i)
    EXPECT_LT((axis(p, i, 0.0) - hung * MbbrKinematics(robot_).T_ob().col(i)).norm(), 1e-12);
}

TEST_F(Drive, MicroSlipIsASineOfTheRollersAngle) {
  MbbrDriveParams p;
  p.roller_slip_N_m = 0.004;
  MbbrDrive drive(robot_, p);
  const Vec3 angle(0.1, -0.2, 0.3);
  drive.begin_step(still_, Vec3::Zero(), angle, 1e-3);
  const Vec3 torque = drive.wheel_torques(still_, Vec3::Zero());
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(torque(i), 0.004 * std::sin(p.rollers_per_turn * angle(i)), 1e-12);
}

/// Planar accelerations of ball or wheels and of the body, upright, under a force along the way at the centre
/// of ball or wheels and one at the mass centre.
struct Planar {
  double mass, body_mass, radius, height, rolling_inertia, body_inertia, between;
  Vec2 under(double below_N, double above_N) const {
    Mat<2, 2> m;
    const double coupling = body_mass * radius * height - between;
    m << mass * radius * radius + rolling_inertia + between, coupling, coupling,
        body_inertia + body_mass * height * height + between;
    return m.inverse() * Vec2(radius * (below_N + above_N), height * above_N);
  }
};

Planar planar(const MbbrParameters& p) { return {p.m_t + p.m_b, p.m_t, p.r, p.l, p.I_b, p.I_t2, p.I_w}; }
Planar planar(const MipParameters& p) {
  return {p.m_b + 2.0 * p.m_w, p.m_b, p.r, p.l, 2.0 * p.I_w1, p.I_b1, 2.0 * p.I_r};
}

TEST(Slope, AndPushAccelerateBothRobotsAsThePlanarEquationsSay) {
  MbbrWorldParams w = without_back_emf<MbbrWorldParams>();
  MipWorldParams m = without_back_emf<MipWorldParams>();
  for (WorldParams* common : {&w.common, &m.common}) common->floor_slope_rad = Vec2(0.02, 0.02);
  const auto expect = [&](double slope, double push_N) {
    const Planar ball = planar(MbbrParameters());
    const Planar wheels = planar(MipParameters());
    const Vec2 a = ball.under(-ball.mass * kGravity_m_s2 * slope, push_N);
    const MbbrEstimate x = run(w, Vec3::Zero(), 1).truth();
    EXPECT_NEAR(x.phi_dot_star.y(), a.x() * kTickS, 0.005 * std::abs(a.x()) * kTickS);
    EXPECT_NEAR(x.omega_B.y(), a.y() * kTickS, 0.005 * std::abs(a.y()) * kTickS);
    // The eduMIP rolls along y, turning about x the other way.
    const Vec2 b = -wheels.under(-wheels.mass * kGravity_m_s2 * slope, push_N);
    const MipEstimate y = run(m, Vec2::Zero(), 1).truth();
    EXPECT_NEAR(y.phi_dot + y.theta_dot, b.x() * kTickS, 0.005 * std::abs(b.x()) * kTickS);
    EXPECT_NEAR(y.theta_dot, b.y() * kTickS, 0.005 * std::abs(b.y()) * kTickS);
  };
  expect(0.02, 0.0);
  for (WorldParams* common : {&w.common, &m.common}) {
    common->floor_slope_rad.setZero();
    common->pushes = {{0.0, 1.0, Vec2(1.5, 1.5)}};
  }
  expect(0.0, 1.5);
}

TEST(RollingResistance, TakesItsShareOfTheWeightOffASlopesPull) {
  // Once faster than 5 mm/s; slope 0.04, resistance 0.01: three quarters of the pull are left.
  MbbrWorldParams w = without_back_emf<MbbrWorldParams>();
  MipWorldParams m = without_back_emf<MipWorldParams>();
  const auto gained = [&](double resistance) {
    for (WorldParams* common : {&w.common, &m.common}) {
      common->floor_slope_rad = Vec2(0.0, 0.04);
      common->rolling_resistance = resistance;
    }
    const auto ball = [&](int ticks) { return run(w, Vec3::Zero(), ticks).truth().phi_dot_star.x(); };
    const auto wheels = [&](int ticks) {
      const MipEstimate x = run(m, Vec2::Zero(), ticks).truth();
      return x.phi_dot + x.theta_dot;
    };
    return Vec2(ball(6) - ball(5), wheels(6) - wheels(5));
  };
  const Vec2 left = gained(0.01).cwiseQuotient(gained(0.0));
  EXPECT_NEAR(left.x(), 0.75, 0.02);
  EXPECT_NEAR(left.y(), 0.75, 0.02);
}

double sigma_of(const std::vector<double>& x) {
  double sum = 0.0;
  double squares = 0.0;
  for (const double v : x) {
    sum += v;
    squares += v * v;
  }
  const auto n = static_cast<double>(x.size());
  return std::sqrt(squares / n - sum * sum / (n * n));
}

TEST(Noise, OfChipAndEncodersHasItsSigma) {
  MbbrWorldParams w = quiet<MbbrWorldParams>();
  w.common.gyro_sigma_rad_s = 0.0014;
  w.common.accel_sigma_m_s2 = 0.04;
  w.common.encoder_sigma_rad = 0.003;
  const Calibration c;
  MbbrWorld world(MbbrParameters(), linear(), c, w);
  std::vector<double> gyro;
  std::vector<double> accel;
  std::vector<double> encoder;
  for (int i = 0; i < 10000; ++i) {
    world.advance(MotorCommand{});  // held
    const RawSample raw = world.sense();
    gyro.push_back(raw.gyro_counts[1] * c.gyro_rad_s_per_count);
    accel.push_back(raw.accel_counts[2] * c.accel_m_s2_per_count);
    encoder.push_back(raw.encoder_counts[2] * 2.0 * kPi / c.encoder_counts_per_rev);
  }
  EXPECT_NEAR(sigma_of(gyro), 0.0014, 0.03 * 0.0014);  // sigma of that: 0.7 %
  EXPECT_NEAR(sigma_of(accel), 0.04, 0.03 * 0.04);
  EXPECT_NEAR(sigma_of(encoder), 0.003, 0.03 * 0.003);
}

TEST(Noise, BiasesOfManyRobotsHaveTheirSigma) {
  MbbrWorldParams w = quiet<MbbrWorldParams>();
  w.common.gyro_bias_sigma_rad_s = 0.005;
  w.common.accel_bias_sigma_m_s2 = 0.05;
  const Calibration c;
  std::vector<double> gyro;
  std::vector<double> accel;
  for (unsigned seed = 1; seed <= 1000; ++seed) {
    w.common.seed = seed;
    const RawSample raw = MbbrWorld(MbbrParameters(), linear(), c, w).sense();
    gyro.push_back(raw.gyro_counts[0] * c.gyro_rad_s_per_count);
    accel.push_back(raw.accel_counts[1] * c.accel_m_s2_per_count);
  }
  EXPECT_NEAR(sigma_of(gyro), 0.005, 0.08 * 0.005);  // sigma of that: 2.2 %
  EXPECT_NEAR(sigma_of(accel), 0.05, 0.08 * 0.05);
}

TEST(AttitudePackets, WanderWithTheirTimeConstantDriftInHeadingAndComeLate) {
  MbbrWorldParams w = quiet<MbbrWorldParams>();
  w.common.attitude_sigma_rad = 0.01;
  w.common.attitude_time_constant_s = 0.1;
  w.common.attitude_heading_drift_rad_sqrt_s = 0.02;
  const auto record = [&] {
    MbbrWorld world(MbbrParameters(), linear(), Calibration(), w);
    std::vector<Vec3> angles;
    for (int i = 0; i < 20000; ++i) {
      world.advance(MotorCommand{});
      const RawSample raw = world.sense();
      const auto& q = raw.attitude_wxyz;
      angles.push_back(
          {std::atan2(2.0 * (q[0] * q[1] + q[2] * q[3]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])), 0.0,
           std::atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))});
    }
    return angles;
  };
  const std::vector<Vec3> prompt = record();
  std::vector<double> roll;
  std::vector<double> change;
  std::vector<double> turned;
  for (std::size_t i = 1; i < prompt.size(); ++i) {
    roll.push_back(prompt[i].x());
    change.push_back(prompt[i].x() - prompt[i - 1].x());
    turned.push_back(prompt[i].z() - prompt[i - 1].z());
  }
  EXPECT_NEAR(sigma_of(roll), 0.01, 0.1 * 0.01);  // 500 independent ones: 3 %
  EXPECT_NEAR(sigma_of(change), 0.01 * std::sqrt(2.0 * (1.0 - std::exp(-kTickS / 0.1))), 0.03 * 0.0031);
  EXPECT_NEAR(sigma_of(turned), 0.02 * std::sqrt(kTickS), 0.03 * 0.02 * std::sqrt(kTickS));
  w.common.attitude_latency_ticks = 3;
  const std::vector<Vec3> late = record();
  for (std::size_t i = 100; i < 110; ++i) EXPECT_LT((late[i] - prompt[i - 3]).norm(), 1e-12);
}

}  // namespace
}  // namespace equipoise
