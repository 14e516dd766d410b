// What the tick makes of what its stages say: which sample, input and command each gets, what safety hears,
// and what the bridges get.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "equipoise/pipeline.hpp"
#include "unit/pipeline/bench.hpp"
#include "unit/pipeline/pairs.hpp"

namespace equipoise {
namespace {

using bench::Bench;
using bench::list;
using bench::near;
using testing::DoubleNear;
using testing::ElementsAre;

constexpr double kNoLoad_rad_s = 80.0;  // of the bench's motors at 8 V

std::vector<double> duties(const MotorCommand& m) { return {m.duty[0], m.duty[1]}; }

/// Both wheels turn with 20 rad/s.
template <class B>
typename B::Result turning(B& b, int ticks = 1) {
  typename B::Result t;
  for (int i = 0; i < ticks; ++i) {
    b.raw.encoder_counts[0] += 10.0;
    b.raw.encoder_counts[1] += 10.0;
    t = b.step();
  }
  return t;
}

TEST(Pipeline, ARobotThatIsWellIsArmedAndDriven) {
  Bench<> b;
  b.script.u = {0.3, 0.1};
  const auto t = b.step();
  EXPECT_EQ(t.arm_state, ArmState::kArmed);
  EXPECT_EQ(t.reasons, 0U);
  EXPECT_EQ(t.degraded, 0U);
  EXPECT_EQ(t.inhibit, 0U);
  EXPECT_FALSE(t.saturated);
  EXPECT_TRUE(t.motors.enable);
  EXPECT_THAT(list(t.u_lin), near(0.3, 0.1));
  EXPECT_THAT(list(t.u_friction), near(0.3, 0.1));
  EXPECT_THAT(duties(t.motors), near(0.4, 0.2));
  EXPECT_EQ(t.motors.duty[2], 0.0);
}

TEST(Pipeline, WhileTheMotorsAreOffTheRobotIsHeldAndTheReferenceIsWhereItIs) {
  Bench<> b;
  b.command.arm = false;
  b.script.x_hat.tilt_rad = 0.05;
  auto t = b.step();
  EXPECT_EQ(t.reasons, kNotRequested);
  EXPECT_EQ(t.arm_state, ArmState::kDisarmed);
  ASSERT_EQ(b.script.updates.size(), 1U);
  EXPECT_TRUE(b.script.updates[0].held);
  EXPECT_THAT(b.script.resets, ElementsAre(0.05));
  b.command.arm = true;
  b.step();
  EXPECT_EQ(b.script.resets.size(), 1U) << "it was off until now";
  t = b.step();
  EXPECT_TRUE(t.motors.enable);
  EXPECT_THAT(b.script.resets, ElementsAre());
  EXPECT_FALSE(b.script.updates[0].held);
}

TEST(Pipeline, AnOldCommandIsAStopAndAnInhibitIsTold) {
  Bench<> b;
  b.step();
  b.command.velocity_W_m_s = {0.3, 0.0};
  b.step();
  EXPECT_EQ(b.script.commands.at(0).velocity_W_m_s.x(), 0.3);
  b.command.age_s = 0.6;
  EXPECT_TRUE(b.step().motors.enable);
  EXPECT_EQ(b.script.commands.at(0).velocity_W_m_s.x(), 0.0);
  const auto t = b.step(0, kGuardDead);
  EXPECT_EQ(t.inhibit, std::uint32_t{kGuardDead});
  EXPECT_EQ(t.reasons, std::uint32_t{kGuardDead});
  EXPECT_FALSE(t.motors.enable);
  EXPECT_EQ(t.arm_state, ArmState::kFault);
}

TEST(Pipeline, DutiesAreScaledToTheBatteryAndTurnedToTheMotors) {
  auto p = Bench<>::usual();
  p.calibration.motor_sign = {1.0, -1.0, 1.0, 1.0};
  Bench<> b(p);
  b.script.u = {0.3, 0.1};
  b.raw.battery_counts = 10.0;
  EXPECT_THAT(duties(b.step().motors), near(0.4 * 8.0 / 10.0, -0.2 * 8.0 / 10.0));
  b.raw.valid &= ~unsigned{RIO_BATTERY};
  EXPECT_THAT(duties(b.step().motors), near(0.4, -0.2)) << "nominal voltage, where nobody knows";
}

TEST(Pipeline, FrictionIsCompensatedAtTheWheelsRatesAndIsNotPartOfTheLinearInput) {
  auto p = Bench<>::usual();
  p.friction.coulomb_u = 0.05;
  Bench<> b(p);
  b.script.u = {0.3, 0.0};
  b.steps(2);
  for (int i = 0; i < 10; ++i) {
    b.raw.encoder_counts[0] += 10.0;  // 20 rad/s
    b.step();
  }
  b.raw.encoder_counts[0] += 10.0;
  const auto t = b.step();
  EXPECT_NEAR(t.z.wheel_rate_rad_s(0), 20.0, 1e-9);
  EXPECT_THAT(list(t.u_lin), near(0.3, 0.0));
  EXPECT_THAT(list(t.u_friction), near(0.325, 0.025));
  EXPECT_THAT(duties(t.motors), near(0.35, 0.3));
  b.step();
  EXPECT_THAT(list(b.script.updates[0].u), near(0.3, 0.0)) << "what the linear model felt";
}

TEST(Pipeline, TheFilterIsGivenWhatTheMotorsDid) {
  Bench<> b;
  b.script.u = {0.3, 0.1};
  b.step();
  b.step();
  EXPECT_THAT(list(b.script.updates[0].u), near(0.3, 0.1));
  // Motors that coast feel the input that just cancels the back-EMF.
  b.command.arm = false;
  b.step();
  for (int i = 0; i < 10; ++i) {
    b.raw.encoder_counts[0] += 4.0;  // 8 rad/s
    b.raw.encoder_counts[1] += 8.0;
    b.step();
  }
  b.step();
  const double first = 8.0 / kNoLoad_rad_s;
  const double second = 16.0 / kNoLoad_rad_s;
  EXPECT_THAT(list(b.script.updates[0].u),
              ElementsAre(DoubleNear((first + second) / 2, 1e-9), DoubleNear((first - second) / 2, 1e-9)));
}

TEST(Pipeline, AnInputThatTheSupplyDoesNotAllowIsCutWheelByWheel) {
  auto p = Bench<>::usual();
  p.friction.coulomb_u = 0.05;
  Bench<> b(p);
  b.raw.battery_counts = 6.4;  // 0.8 of nominal
  b.script.u = {0.7, 0.3};
  auto t = b.step();
  EXPECT_TRUE(t.saturated);
  EXPECT_THAT(duties(t.motors), near(1.0, 0.4 / 0.8));
  b.step();
  EXPECT_THAT(list(b.script.updates[0].u), near((0.8 + 0.4) / 2, (0.8 - 0.4) / 2));
  b.script.u = {-0.7, -0.3};
  t = b.step();
  EXPECT_THAT(duties(t.motors), near(-1.0, -0.4 / 0.8));
  b.script.u = {0.39, 0.39};
  t = b.step();
  EXPECT_FALSE(t.saturated);
  EXPECT_THAT(duties(t.motors), near(0.78 / 0.8, 0.0));
}

TEST(Pipeline, WhatWasCutIsToldWithoutTheFrictionsShare) {
  auto p = Bench<>::usual();
  p.friction.coulomb_u = 0.1;
  Bench<> b(p);
  turning(b, 10);  // friction is 0.1 of the first input
  b.script.u = {1.5, 0.0};
  EXPECT_TRUE(turning(b).saturated);
  b.step();
  EXPECT_THAT(list(b.script.updates[0].u), near(1.0 - 0.1, 0.0));
}

TEST(Pipeline, AControllerThatSharesDutyHasItsAllocationAsked) {
  Bench<bench::Robot, true> b;
  b.script.u = {0.9, 0.3};
  const auto t = b.step();
  EXPECT_TRUE(t.saturated);
  EXPECT_THAT(duties(t.motors), near(0.9, 0.9)) << "the difference is given up";
  b.step();
  EXPECT_THAT(list(b.script.updates[0].u), near(0.9, 0.0));
}

TEST(Pipeline, ADutyOfOneIsSaturated) {
  Bench<> b;
  b.script.u = {1.0, 0.0};
  EXPECT_TRUE(b.step().saturated);
  b.script.u = {0.999, 0.0};
  EXPECT_FALSE(b.step().saturated);
  b.script.u = {0.6, 0.5};
  EXPECT_EQ(turning(b, 200).reasons, 0U) << "no fault: what stands may need all that it has for long";
}

// --- what is missing, and what stands in for it

using Health = EstimatorHealth<2>;

Health predicting() {
  Health health;
  health.predicts_wheels = true;
  return health;
}

TEST(Pipeline, WhatAnArmedRobotDoesWithoutIsTold) {
  const auto degraded = [](const Health& health, unsigned without = 0) {
    Bench<> b;
    b.script.health = predicting();
    b.steps(3);
    b.script.health = health;
    b.without(without);
    return b.step().degraded;
  };
  Health health = predicting();
  EXPECT_EQ(degraded(health), 0U);
  EXPECT_EQ(degraded(health, RIO_IMU), std::uint32_t{kWithoutImu});
  EXPECT_EQ(degraded(health, RIO_ENCODERS), std::uint32_t{kWithoutEncoders});
  health.lost = 2;
  EXPECT_EQ(degraded(health), std::uint32_t{kWithoutWheelTwo});
  health.gyro_bias_jumped = true;
  EXPECT_EQ(degraded(health, RIO_IMU), std::uint32_t{kWithoutWheelTwo | kGyroBiasJumped | kWithoutImu});
  health = predicting();
  health.gyro_left_out = true;
  EXPECT_EQ(degraded(health), std::uint32_t{kWithoutGyroAxis});
  EXPECT_EQ(degraded(health, RIO_IMU | RIO_ENCODERS),
            std::uint32_t{kWithoutGyroAxis | kWithoutImu | kWithoutEncoders});

  Bench<> off;
  off.command.arm = false;
  off.script.health = health;
  off.without(RIO_IMU);
  EXPECT_EQ(off.step().degraded, 0U) << "nothing is done yet";
}

TEST(Pipeline, WithLessOfItsSensorsTheRobotIsSlowed) {
  Bench<> b;
  b.script.health = predicting();
  b.steps(2);
  b.command.velocity_W_m_s = {0.3, 0.0};
  b.script.health.lost = 1;
  b.step();
  EXPECT_NEAR(b.script.commands.at(0).velocity_W_m_s.x(), 0.1, 1e-12);
}

TEST(Pipeline, TheModelsRateStandsInForAnEncoderThatIsNotToBeHad) {
  Bench<> b;
  turning(b, 10);
  b.script.health.wheel_rate_rad_s = {5.0, -7.0};
  b.script.health.lost = 2;
  EXPECT_THAT(list(turning(b).z.wheel_rate_rad_s),
              ElementsAre(DoubleNear(20.0, 1e-9), DoubleNear(20.0, 1e-9)))
      << "a model that predicts none";
  b.script.health.predicts_wheels = true;
  EXPECT_THAT(list(turning(b).z.wheel_rate_rad_s), ElementsAre(DoubleNear(20.0, 1e-9), -7.0));
  b.script.health.lost = 1;
  EXPECT_THAT(list(turning(b).z.wheel_rate_rad_s), ElementsAre(5.0, DoubleNear(20.0, 1e-9)));
  b.script.health.lost = 0;
  b.without(RIO_ENCODERS);
  EXPECT_THAT(list(b.step().z.wheel_rate_rad_s), ElementsAre(5.0, -7.0));
}

TEST(Pipeline, AnglesThatCannotBeReadGoOnAsTheWheelsAreExpectedToTurn) {
  const auto gone_on_rad = [](bool arm, const Health& health) {
    Bench<> b;
    b.command.arm = arm;
    b.script.health = health;
    const Vec<2> before = turning(b, 10).z.wheel_angle_rad;
    b.without(RIO_ENCODERS);
    return list(b.step().z.wheel_angle_rad - before);
  };
  Health health;
  health.wheel_rate_rad_s = {8.0, -6.0};
  EXPECT_THAT(gone_on_rad(true, health), ElementsAre(DoubleNear(0.1, 1e-9), DoubleNear(0.1, 1e-9)));
  health.predicts_wheels = true;
  EXPECT_THAT(gone_on_rad(true, health), ElementsAre(DoubleNear(0.04, 1e-9), DoubleNear(-0.03, 1e-9)));
  EXPECT_THAT(gone_on_rad(false, health), ElementsAre(DoubleNear(0.1, 1e-9), DoubleNear(0.1, 1e-9)));
}

TEST(Pipeline, AnEncoderMayJumpByHalfAgainOfWhatItsWheelCanTurn) {
  // 120 rad/s are 60 counts in a tick, and one of rounding.
  for (const auto& [counts, moved_rad] : {std::pair{61.0, 0.61}, {61.5, 0.0}, {-61.0, -0.61}, {-61.5, 0.0}}) {
    Bench<> b;
    b.command.arm = false;
    const double before = b.steps(3).z.wheel_angle_rad(0);
    b.raw.encoder_counts[0] += counts;
    EXPECT_NEAR(b.step().z.wheel_angle_rad(0) - before, moved_rad, 1e-9) << counts;
  }
}

TEST(Pipeline, ASampleThatRepeatsItselfIsNoneFromTheConfiguredCountOn) {
  auto p = Bench<>::usual();
  p.safety.max_identical_samples = 2;
  Bench<> b(p);
  b.step();
  b.gyro_noise = {};
  b.accel_noise = 0.0;
  EXPECT_TRUE(b.step().z.imu_ok);
  EXPECT_FALSE(b.step().z.imu_ok);
}

// --- ticks that the loop has missed

TEST(Pipeline, TheModelRunsOnThroughMissedTicks) {
  Bench<> b;
  b.script.u = {0.3, 0.1};
  b.steps(2);
  b.step(3);
  const auto& updates = b.script.updates;
  ASSERT_EQ(updates.size(), 4U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_FALSE(updates[i].z.imu_ok || updates[i].z.encoders_ok || updates[i].z.attitude_ok);
    EXPECT_FALSE(updates[i].held);
    EXPECT_THAT(list(updates[i].u), near(0.3, 0.1));
  }
  EXPECT_TRUE(updates[3].z.imu_ok && updates[3].z.encoders_ok);
  EXPECT_EQ(updates[3].z.ticks, 4);
  EXPECT_THAT(list(updates[3].u), near(0.3, 0.1));
  b.step();
  EXPECT_EQ(b.script.updates.size(), 1U);
}

TEST(Pipeline, WithTheMotorsOffMissedTicksAreNone) {
  Bench<> b;
  b.command.arm = false;
  b.step();
  b.step(3);
  EXPECT_EQ(b.script.updates.size(), 1U);
}

/// First input that the filter is given for each of the five missed ticks and for the one after.
std::vector<double> given_over_a_gap(bool predicts, std::uint32_t inhibit) {
  Bench<> b;
  b.script.u = {0.3, 0.0};
  b.script.health.predicts_wheels = predicts;
  b.script.health.wheel_rate_rad_s.setConstant(-40.0);
  turning(b, 10);
  b.script.health.wheel_rate_rad_s.setConstant(8.0);
  b.raw.encoder_counts[0] += 60.0;
  b.raw.encoder_counts[1] += 60.0;
  b.step(5, inhibit);
  std::vector<double> given;
  for (const bench::Update& update : b.script.updates) given.push_back(std::round(1e9 * update.u(0)) / 1e9);
  return given;
}

TEST(Pipeline, WhenTheGuardHasCutInTheMotorsCoastedFromItsFourthTickOn) {
  EXPECT_THAT(given_over_a_gap(true, 0), ElementsAre(0.3, 0.3, 0.3, 0.3, 0.3, 0.3));
  EXPECT_THAT(given_over_a_gap(true, kWriteFailed), ElementsAre(0.3, 0.3, 0.3, 0.3, 0.3, 0.3));
  EXPECT_THAT(given_over_a_gap(true, kOverrun), ElementsAre(0.3, 0.3, 0.3, 0.1, 0.1, 0.1))
      << "by the model's rate, 8 of 80 rad/s";
}

/// The tick after a stall has its own time to keep: what ends the run anyway is not caught up with.
TEST(Pipeline, AStallThatDisarmsIsNotCaughtUpWith) {
  const auto updates = [](bool predicts, int missed, std::uint32_t inhibit) {
    Bench<> b;
    b.script.health.predicts_wheels = predicts;
    b.steps(2);
    b.step(missed, inhibit);
    return b.script.updates.size();
  };
  EXPECT_EQ(updates(true, 12, kOverrun), 13U);
  EXPECT_EQ(updates(true, 13, kOverrun), 1U) << "longer than safety.max_stalled_ticks";
  EXPECT_EQ(updates(false, 12, kOverrun), 1U) << "an estimator whose model does not bridge";
  EXPECT_EQ(updates(false, 2, 0), 3U);
}

}  // namespace
}  // namespace equipoise
