// Each effect of the full world alone: with it the robot moves or measures differently, in the way it should.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "equipoise/plant/switched_motor.hpp"
#include "support/assign.hpp"
#include "unit/plant/level_world.hpp"

namespace equipoise {
namespace {

using Duties = std::array<double, 3>;
constexpr Duties kSpin{0.9, 0.9, 0.9};
constexpr Duties kTip{0.95, -0.8, 0.7};

/// A world with the motors on at these duties for `ticks`.
class World {
 public:
  explicit World(const MbbrWorldParams& params)
      : world_(MbbrParameters(), MotorParameters(), Calibration(), params) {}
  const World& run(const Duties& duty, int ticks) {
    MotorCommand command{};
    command.enable = true;
    for (std::size_t i = 0; i < duty.size(); ++i) command.duty[i] = duty[i];
    for (int i = 0; i < ticks; ++i) {
      world_.advance(command);
      raw_ = world_.sense();
    }
    return *this;
  }
  MbbrEstimate truth() const { return world_.truth(); }
  const RawSample& raw() const { return raw_; }
  double battery_V() const { return world_.battery_V(); }
  /// Ball angle about the body's z that the encoders report.
  double seen_spin_rad() const {
    const Calibration c;
    Vec3 wheels;
    for (std::size_t i = 0; i < 3; ++i)
      wheels(static_cast<int>(i)) = raw_.encoder_counts[i] * 2.0 * kPi / c.encoder_counts_per_rev;
    return MbbrKinematics(MbbrParameters()).ball_from_wheels(wheels).z();
  }

 private:
  MbbrWorld world_;
  RawSample raw_{};
};

double spin_after(const MbbrWorldParams& w, double direction) {
  return std::abs(World(w).run({direction * 0.9, direction * 0.9, direction * 0.9}, 20).truth().theta_z);
}

TEST(MbbrDisturbance, StictionHoldsWhatCoulombFrictionLetsGo) {
  // Spinning up needs more than mu_c / ratio per wheel: 1.2 times Coulomb, below 1.5 times.
  const MbbrParameters robot;
  const MotorParameters motor;
  MbbrWorldParams w = level_world();
  MotorParameters brake = motor;
  brake.bridge = BridgeType::kDriveBrake;
  const double duty = 1.2 * robot.mu_c / (robot.r / robot.r_w * std::sqrt(3.0) * motor.k1());
  const auto turned = [&](const MbbrWorldParams& params) {
    MbbrWorld world(robot, brake, Calibration(), params);
    MotorCommand command{};
    command.enable = true;
    assign(command.duty, {duty, duty, duty});
    for (int i = 0; i < 40; ++i) world.advance(command);
    return std::abs(world.truth().theta_z);
  };
  EXPECT_GT(turned(w), 0.05);
  w.common.stiction.static_ratio = 1.5;
  EXPECT_LT(turned(w), 1e-9);
}

TEST(MbbrDisturbance, StictionIsGoneWhenMoving) {
  Stiction stiction;
  stiction.static_ratio = 1.5;
  EXPECT_NEAR(stiction.factor(0.0), 1.5, 1e-15);
  EXPECT_NEAR(stiction.factor(stiction.rate_rad_s), 1.0 + 0.5 / std::exp(1.0), 1e-15);
  EXPECT_NEAR(stiction.factor(-5.0), 1.0, 1e-15);
}

TEST(MbbrDisturbance, YawFrictionDependsOnTheDirectionOfSpin) {
  MbbrWorldParams w = level_world();
  EXPECT_NEAR(spin_after(w, 1.0), spin_after(w, -1.0), 1e-9);
  w.yaw_friction_scale = Vec2(1.3, 0.7);  // ball about body z: positive duties turn it positively
  EXPECT_LT(spin_after(w, 1.0), 0.98 * spin_after(w, -1.0));
  EXPECT_NEAR(friction_limit_N_m(w, 0.05, Vec3(0, 0, 1)).z(), 0.065, 1e-15);
  EXPECT_NEAR(friction_limit_N_m(w, 0.05, Vec3(0, 0, -1)).z(), 0.035, 1e-15);
  EXPECT_NEAR(friction_limit_N_m(w, 0.05, Vec3(0, 0, -1)).x(), 0.05, 1e-15);
}

TEST(MbbrDisturbance, DiodeDropMatchesTheSwitchingMotor) {
  SwitchedMotorParams p;
  p.diode_drop_V = 0.8;
  constexpr double kSupply_V = 8.0;
  for (const double hz : {500.0, 5e3, 20e3}) {
    p.pwm_hz = hz;
    const double T_r = p.resistance_ohm / (p.inductance_H * hz);
    for (const double omega_r : {-0.8, 0.0, 0.5}) {
      for (const double u : {-0.9, -0.3, 0.2, 0.7}) {
        SwitchedMotor motor(p);
        motor.hold_speed(omega_r * kSupply_V / p.torque_constant_N_m_A);
        for (int i = 0; i < 1000; ++i) motor.period(u, kSupply_V);
        const double before = motor.charge_C();
        motor.period(u, kSupply_V);
        const double mean = (motor.charge_C() - before) * hz * p.resistance_ohm / kSupply_V;
        const double opposing = 1.0 + 2.0 * p.diode_drop_V / kSupply_V;
        EXPECT_NEAR(DriveCoastCommand(T_r, u).mean_current(omega_r, opposing), mean, 1e-10);
        EXPECT_NEAR(DriveCoastCommand(T_r, u).mean_current(omega_r, 1.0),
                    drive_coast_mean_current(T_r, omega_r, u), 1e-12);
      }
    }
  }
}

TEST(MbbrDisturbance, DiodeDropTakesTorqueFromPartialDuty) {
  MbbrWorldParams w = level_world();
  w.common.friction = false;
  const double plain = std::abs(World(w).run({0.5, 0.5, 0.5}, 20).truth().theta_z);
  w.common.diode_drop_V = 0.7;
  EXPECT_LT(std::abs(World(w).run({0.5, 0.5, 0.5}, 20).truth().theta_z), 0.98 * plain);
}

TEST(MbbrDisturbance, ContactsAreUnitNormalsPerpendicularToTheAxes) {
  const MbbrParameters robot;
  const Mat3 contacts = wheel_contacts(robot);
  const Mat3 axes = MbbrKinematics(robot).T_ob();
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(contacts.col(i).norm(), 1.0, 1e-12);
    EXPECT_NEAR(contacts.col(i).dot(axes.col(i)), 0.0, 1e-12);
    EXPECT_NEAR(contacts(2, i), std::cos(kPi / 3.0), 1e-12);
  }
}

TEST(MbbrDisturbance, RowsAlternateTwelveTimesPerTurn) {
  int changes = 0;
  Vec3 before = roller_rows(12.0, Vec3::Constant(1e-6));
  for (int i = 1; i < 10000; ++i) {
    const Vec3 now = roller_rows(12.0, Vec3::Constant(2.0 * kPi * i / 10000.0));
    changes += now.x() != before.x() ? 1 : 0;
    before = now;
  }
  EXPECT_EQ(changes, 23);  // both rows, twelve rollers each, less the start of the turn
}

TEST(MbbrDisturbance, BacklashPassesNothingUntilTheGapIsCrossed) {
  GearPlayParams p;
  p.play_rad = 0.02;
  p.rotor_inertia_kg_m2 = 1e-5;
  GearPlay gear;
  int crossing = 0;
  while (!gear.step(p, 0.02, 1e-3)) ++crossing;
  EXPECT_NEAR(gear.ahead_rad(), 0.01, 1e-12);
  // Half the gap at 2000 rad/s^2: 3.2 ms; the whole gap back: 4.5 ms.
  EXPECT_GE(crossing, 3);
  EXPECT_LE(crossing, 4);
  int back = 0;
  while (!gear.step(p, -0.02, 1e-3)) ++back;
  EXPECT_GT(back, crossing);
  EXPECT_NEAR(gear.ahead_rad(), -0.01, 1e-12);
}

TEST(MbbrDisturbance, BacklashDelaysTheStartAndTheEncodersSeeTheMotor) {
  MbbrWorldParams w = level_world();
  const double plain = std::abs(World(w).run(kSpin, 2).truth().theta_z);
  w.drive.gear.play_rad = 0.1;
  World world(w);
  world.run(kSpin, 2);
  EXPECT_LT(std::abs(world.truth().theta_z), 0.9 * plain);
  // Held wheels would be where the body's turn puts them; the motors are half the play ahead.
  const MbbrParameters robot;
  const double ahead = world.seen_spin_rad() + world.truth().theta_z;
  EXPECT_NEAR(ahead, 0.05 * std::sqrt(3.0) * robot.r_w / robot.r, 1e-3);
}

TEST(MbbrDisturbance, GripIsFrictionUnderALoadThatTheLatitudeMultiplies) {
  // (2.2): m g / (3 cos 60 deg) = 3.593 N per wheel
  EXPECT_NEAR(grip_limit_N_m(0.5, MbbrParameters()), 0.5 * 3.5933 * 0.0125, 1e-5);
}

TEST(MbbrDisturbance, SlippingWheelsReportMoreThanTheBallTurned) {
  MbbrWorldParams w = level_world();
  World grips(w);
  grips.run(kSpin, 10);
  EXPECT_NEAR(grips.seen_spin_rad(), -grips.truth().theta_z, 1e-9);
  w.drive.wheel_grip = 0.5;
  World slips(w);
  slips.run(kSpin, 10);
  EXPECT_LT(std::abs(slips.truth().theta_z), 0.7 * std::abs(grips.truth().theta_z));
  EXPECT_GT(slips.seen_spin_rad(), -slips.truth().theta_z + 0.1);
}

TEST(MbbrDisturbance, APushMovesTheRobotAndTheAccelerometerFeelsIt) {
  MbbrWorldParams w = level_world();
  w.common.friction = false;
  w.common.pushes.push_back({0.0, 0.02, Vec2(2.0, 0.0)});
  World world(w);
  world.run({0.0, 0.0, 0.0}, 2);
  EXPECT_GT(world.truth().theta_xy.y(), 1e-4);
  const Calibration c;
  EXPECT_GT(world.raw().accel_counts[0] * c.accel_m_s2_per_count, 1.0);
}

TEST(MbbrDisturbance, AMisalignedImuSeesYawAsTiltingAndUprightAsTilted) {
  MbbrWorldParams w = level_world();
  w.common.imu_misalignment_rad = Vec3(0.05, 0.0, 0.0);
  World world(w);
  world.run(kSpin, 20);
  const Calibration c;
  const double yaw = world.truth().omega_B.z();
  EXPECT_GT(std::abs(yaw), 0.5);
  EXPECT_NEAR(world.raw().gyro_counts[1] * c.gyro_rad_s_per_count, std::sin(0.05) * yaw, 1e-3);
  const auto& q = world.raw().attitude_wxyz;
  EXPECT_NEAR(std::atan2(2.0 * (q[0] * q[1] + q[2] * q[3]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])), 0.05,
              1e-3);
}

TEST(MbbrDisturbance, ImuBiasIsConstantAndItsRangeClips) {
  MbbrWorldParams w = level_world();
  w.common.gyro_bias_sigma_rad_s = 0.1;
  World biased(w);
  biased.run({0.0, 0.0, 0.0}, 1);
  const auto first = biased.raw().gyro_counts;
  EXPECT_NE(first[0], 0.0);
  biased.run({0.0, 0.0, 0.0}, 10);
  EXPECT_NEAR(biased.raw().gyro_counts[0], first[0], 1e-6);

  w.common.gyro_bias_sigma_rad_s = 100.0;  // far beyond 2000 deg/s
  w.common.quantise = true;
  World clipped(w);
  clipped.run({0.0, 0.0, 0.0}, 1);
  double largest = 0.0;
  for (const double n : clipped.raw().gyro_counts) largest = std::max(largest, std::abs(n));
  EXPECT_GE(largest, 32767.0);
  EXPECT_LE(largest, 32768.0);
}

TEST(MbbrDisturbance, LatenciesDelayWhatTheyName) {
  MbbrWorldParams w = level_world();
  World prompt(w);
  w.common.sensor_latency_ticks = 2;
  World late(w);
  prompt.run(kTip, 10);
  late.run(kTip, 12);
  EXPECT_THAT(prompt.raw().encoder_counts, testing::ElementsAreArray(late.raw().encoder_counts));
  EXPECT_EQ(prompt.raw().t_ns + 10'000'000, late.raw().t_ns);

  MbbrWorldParams slow = level_world();
  slow.common.actuation_latency_steps = 3;
  EXPECT_LT(World(slow).run(kTip, 1).truth().phi.norm(),
            0.5 * World(level_world()).run(kTip, 1).truth().phi.norm());
}

TEST(MbbrDisturbance, TheSameSeedGivesTheSameNumbers) {
  MbbrWorldParams w = level_world();
  w.common.gyro_sigma_rad_s = 0.001;
  w.drive.roller_tilt_rad = 0.1;
  w.drive.gear.play_rad = 0.02;
  World a(w);
  World b(w);
  a.run(kTip, 20);
  b.run(kTip, 20);
  EXPECT_THAT(a.raw().gyro_counts, testing::ElementsAreArray(b.raw().gyro_counts));
  EXPECT_THAT(a.raw().encoder_counts, testing::ElementsAreArray(b.raw().encoder_counts));
}

}  // namespace
}  // namespace equipoise
