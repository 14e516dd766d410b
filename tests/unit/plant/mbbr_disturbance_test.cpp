#include "equipoise/plant/mbbr_disturbance.hpp"

#include <gtest/gtest.h>

#include "equipoise/plant/mbbr_world.hpp"
#include "equipoise/plant/switched_motor.hpp"

namespace equipoise {
namespace {

/// A quiet disturbed world, with the motors on at these duties for `ticks`.
class World {
 public:
  explicit World(const MbbrDisturbanceParams& p, bool disturbed = true) : world_(make(p, disturbed)) {}
  void run(const std::array<double, 3>& duty, int ticks) {
    MotorCommand command;
    command.enable = true;
    for (std::size_t i = 0; i < 3; ++i) command.duty[i] = duty[i];
    for (int i = 0; i < ticks; ++i) {
      world_.advance(command);
      raw_ = world_.sense();
    }
  }
  MbbrEstimate truth() const { return world_.truth(); }
  const RawSample& raw() const { return raw_; }

 private:
  static MbbrWorld make(const MbbrDisturbanceParams& p, bool disturbed) {
    WorldParams w;
    w.initial_tilt_rad = 0.0;
    w.disturbed = disturbed;
    w.disturbance = p;
    return MbbrWorld(MbbrParameters(), MotorParameters(), Calibration(), w);
  }
  MbbrWorld world_;
  RawSample raw_;
};

constexpr std::array<double, 3> kSpin{0.9, 0.9, 0.9};
constexpr std::array<double, 3> kTip{0.95, -0.8, 0.7};

TEST(MbbrDisturbance, AllOffIsTheUndisturbedWorld) {
  World plain({}, false);
  World off({}, true);
  plain.run(kTip, 40);
  off.run(kTip, 40);
  EXPECT_NEAR((plain.truth().theta_xy - off.truth().theta_xy).norm(), 0.0, 1e-12);
  EXPECT_NEAR((plain.truth().phi - off.truth().phi).norm(), 0.0, 1e-11);
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
        EXPECT_NEAR(drive_coast_mean_current_with_drop(T_r, omega_r, u, opposing), mean, 1e-10);
        EXPECT_NEAR(drive_coast_mean_current_with_drop(T_r, omega_r, u, 1.0),
                    drive_coast_mean_current(T_r, omega_r, u), 1e-12);
      }
    }
  }
}

TEST(MbbrDisturbance, StribeckRaisesFrictionAtRestOnly) {
  MbbrDisturbanceParams p;
  p.static_ratio = 1.5;
  EXPECT_NEAR(friction_limit_N_m(p, 0.05, Vec3::Zero()).x(), 0.075, 1e-15);
  EXPECT_NEAR(friction_limit_N_m(p, 0.05, Vec3::Constant(5.0)).x(), 0.05, 1e-15);
}

TEST(MbbrDisturbance, YawFrictionDependsOnTheDirection) {
  MbbrDisturbanceParams p;
  p.yaw_friction_scale = Vec2(1.2, 0.7);
  EXPECT_NEAR(friction_limit_N_m(p, 0.05, Vec3(0, 0, 1)).z(), 0.06, 1e-15);
  EXPECT_NEAR(friction_limit_N_m(p, 0.05, Vec3(0, 0, -1)).z(), 0.035, 1e-15);
  EXPECT_NEAR(friction_limit_N_m(p, 0.05, Vec3(0, 0, -1)).x(), 0.05, 1e-15);
  World symmetric({});
  World asymmetric(p);
  for (World* w : {&symmetric, &asymmetric}) w->run(kSpin, 20);
  EXPECT_NE(symmetric.truth().theta_z, asymmetric.truth().theta_z);
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

TEST(MbbrDisturbance, RollerTiltTurnsSomeTranslationIntoYaw) {
  MbbrDisturbanceParams p;
  World plain(p);
  p.roller_tilt_rad = 0.1;
  World tilted(p);
  for (World* w : {&plain, &tilted}) w->run(kTip, 10);
  EXPECT_GT(std::abs(plain.truth().theta_z - tilted.truth().theta_z), 1e-4);
}

TEST(MbbrDisturbance, RollerSlipRipplesTheTorque) {
  MbbrDisturbanceParams p;
  World plain(p);
  p.roller_slip_N_m = 0.01;
  World rippled(p);
  for (World* w : {&plain, &rippled}) w->run(kTip, 10);
  EXPECT_GT((plain.truth().theta_xy - rippled.truth().theta_xy).norm(), 1e-5);
}

TEST(MbbrDisturbance, BacklashPassesNothingUntilTheGapIsCrossed) {
  MbbrDisturbanceParams p;
  p.backlash_rad = 0.02;
  Backlash gap;
  int crossing = 0;
  while (gap.step(p, 0.02, 1e-3) == 0.0) ++crossing;
  EXPECT_NEAR(gap.offset_rad(), 0.01, 1e-12);
  // Half the gap at 2000 rad/s^2: 3.2 ms; the whole gap back: 4.5 ms.
  EXPECT_GE(crossing, 3);
  EXPECT_LE(crossing, 4);
  int back = 0;
  while (gap.step(p, -0.02, 1e-3) == 0.0) ++back;
  EXPECT_GT(back, crossing);
  EXPECT_NEAR(gap.offset_rad(), -0.01, 1e-12);
}

TEST(MbbrDisturbance, TorqueImbalanceChangesTheTorque) {
  MbbrDisturbanceParams p;
  World plain(p);
  p.wheel_torque_scale = Vec3(1.115, 1.0, 1.0);  // [T] section 5.3
  World uneven(p);
  for (World* w : {&plain, &uneven}) w->run(kTip, 10);
  const double moved = plain.truth().phi.norm();
  EXPECT_GT((plain.truth().phi - uneven.truth().phi).norm(), 0.02 * moved);
}

TEST(MbbrDisturbance, GripLimitsTheTorqueAndTheMotorRunsAhead) {
  const Grip held = limit_by_grip(0.02, 0.05, 0.0016);
  EXPECT_EQ(held.torque_N_m, 0.02);
  EXPECT_EQ(held.slip_rad_s, 0.0);
  const Grip slips = limit_by_grip(-0.08, 0.05, 0.0015);
  EXPECT_EQ(slips.torque_N_m, -0.05);
  EXPECT_NEAR(slips.slip_rad_s, -20.0, 1e-9);
  MbbrDisturbanceParams p;
  p.wheel_grip = 0.5;
  // (2.2): m g / (3 cos 60 deg) = 3.593 N per wheel
  EXPECT_NEAR(grip_limit_N_m(p, MbbrParameters()), 0.5 * 3.5933 * 0.0125, 1e-5);
}

TEST(MbbrDisturbance, SlopeRollsTheRobotDownhill) {
  MbbrDisturbanceParams p;
  p.floor_slope_rad = Vec2(0.02, 0.0);  // rises towards +x
  World world(p);
  world.run({0.0, 0.0, 0.0}, 20);
  const Vec2 position = ball_velocity(MbbrParameters().r, world.truth().phi);
  EXPECT_LT(position.x(), -1e-6);
  EXPECT_NEAR(position.y(), 0.0, 1e-9);
}

TEST(MbbrDisturbance, MisalignedImuSeesYawAsTilting) {
  MbbrDisturbanceParams p;
  p.imu_misalignment_rad = Vec3(0.05, 0.0, 0.0);
  World world(p);
  world.run(kSpin, 20);
  const Calibration c;
  const double yaw = world.truth().omega_B.z();
  EXPECT_GT(std::abs(yaw), 0.5);
  EXPECT_NEAR(world.raw().gyro_counts[1] * c.gyro_rad_s_per_count, std::sin(0.05) * yaw, 1e-3);
}

TEST(MbbrDisturbance, LatenciesDelayWhatTheyName) {
  MbbrDisturbanceParams p;
  World prompt(p);
  p.sensor_latency_ticks = 2;
  World late(p);
  prompt.run(kTip, 10);
  late.run(kTip, 12);
  EXPECT_EQ(prompt.raw().encoder_counts, late.raw().encoder_counts);
  EXPECT_EQ(prompt.raw().t_ns + 10'000'000, late.raw().t_ns);

  p.sensor_latency_ticks = 0;
  p.actuation_latency_steps = 3;
  World slow(p);
  World fast({});
  slow.run(kTip, 1);
  fast.run(kTip, 1);
  EXPECT_LT(slow.truth().phi.norm(), 0.5 * fast.truth().phi.norm());
}

TEST(MbbrDisturbance, ExtraFrictionSlowsTheSpin) {
  MbbrDisturbanceParams viscous;
  viscous.extra_viscous_N_m_s = 0.01;
  MbbrDisturbanceParams coulomb;
  coulomb.coulomb_scale = 1.5;
  World plain({});
  World sticky(viscous);
  World rough(coulomb);
  for (World* w : {&plain, &sticky, &rough}) w->run(kSpin, 20);
  EXPECT_LT(std::abs(sticky.truth().theta_z), std::abs(plain.truth().theta_z));
  EXPECT_LT(std::abs(rough.truth().theta_z), std::abs(plain.truth().theta_z));
}

}  // namespace
}  // namespace equipoise
