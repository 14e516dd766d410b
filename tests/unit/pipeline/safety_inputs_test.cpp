// What safety hears of what the tick's stages say, and the shake that tries the encoders.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "unit/pipeline/bench.hpp"
#include "unit/pipeline/pairs.hpp"

namespace equipoise {
namespace {

using bench::Bench;
using bench::list;
using bench::near;
using Health = EstimatorHealth<2>;

/// Reasons after so many ticks of an armed robot with this health.
std::uint32_t reasons_with(const Health& health, int ticks = 1) {
  Bench<> b;
  b.steps(2);
  b.script.health = health;
  return b.steps(ticks).reasons;
}

TEST(Pipeline, WhatTheEstimatorFindsOutWhileArming) {
  Health health;
  health.lost = 2;
  EXPECT_EQ(reasons_with(health), 0U) << "the robot runs on without";
  health.backwards = 2;
  EXPECT_EQ(reasons_with(health), std::uint32_t{kEncoderSign | kWheelTwo});
  health = {};
  health.dead = 3;
  EXPECT_EQ(reasons_with(health), std::uint32_t{kEncoderStuck | kWheelOne | kWheelTwo});
}

TEST(Pipeline, WhatTheEstimatorDoubtsStopsTheMotors) {
  Health health;
  health.bias_drift_rad_s = 0.2;
  EXPECT_EQ(reasons_with(health), std::uint32_t{kImuUntrusted});
  health = {};
  health.motor_error = 3.0;
  EXPECT_EQ(reasons_with(health), std::uint32_t{kMotorFault});
  health = {};
  health.tilt_sigma_rad = 0.2;
  EXPECT_EQ(reasons_with(health), std::uint32_t{kEstimatorUnhealthy});
  health = {};
  health.gyro_trusted = false;
  EXPECT_EQ(reasons_with(health), std::uint32_t{kImuUntrusted});
}

TEST(Pipeline, AnAccelerometerThatIsFrozenIsNotTrusted) {
  Bench<> b;
  b.steps(2);
  b.accel_noise = 0.0;
  EXPECT_EQ(b.steps(9).reasons, 0U);
  EXPECT_EQ(b.step().reasons, std::uint32_t{kImuUntrusted});
}

TEST(Pipeline, OnlyAModelThatPredictsBridgesAGap) {
  for (const bool predicts : {true, false}) {
    Bench<> b;
    b.script.health.predicts_wheels = predicts;
    b.steps(2);
    b.without(RIO_IMU);
    EXPECT_EQ(b.steps(5).reasons, predicts ? 0U : std::uint32_t{kImuStale});
  }
}

/// Ticks until a surprise of the estimator's is too much; 0: it is not.
int ticks_until_surprised(const Health& health, bool isolates = true) {
  Bench<> b(Bench<>::usual(), isolates);
  b.step();
  b.script.health = health;
  b.script.x_hat.innovation = 100.0;
  for (int tick = 1; tick <= 15; ++tick) {
    if ((b.step().reasons & kEstimatorUnhealthy) != 0) return tick;
  }
  return 0;
}

TEST(Pipeline, ASurpriseIsNoneWhileEncodersAreOnTrialAndForgottenOnceWhereASensorIsLeftOut) {
  Health health;
  EXPECT_EQ(ticks_until_surprised(health), 11) << "longer than 0.05 s";
  EXPECT_EQ(ticks_until_surprised(health, false), 0) << "the wheels are shaken for 36 ticks";
  health.checking = true;
  EXPECT_EQ(ticks_until_surprised(health), 0);
  health.checking = false;
  health.gyro_bias_jumped = true;
  EXPECT_EQ(ticks_until_surprised(health), 11) << "no sensor is left out";
  health.lost = 1;
  EXPECT_EQ(ticks_until_surprised(health), 1 + 6) << "a tick later, and of less patience";
  health = {};
  health.gyro_left_out = true;
  EXPECT_EQ(ticks_until_surprised(health), 1 + 6);
}

TEST(Pipeline, WhatIsNotFiniteStopsTheMotorsWhereverItCameFrom) {
  Bench<> b;
  b.steps(2);
  b.script.u = {std::numeric_limits<double>::infinity(), 0.0};
  EXPECT_EQ(b.step().reasons, std::uint32_t{kNotFinite}) << "though a bridge would take it for full duty";
  Bench<> other;
  other.steps(2);
  other.script.x_hat.tilt_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(other.step().reasons & kNotFinite, 0U);
}

// --- the encoders' check

TEST(Pipeline, WheelsAreShakenAfterArmingUnlessTheEstimatorTellsTheirEncodersApart) {
  Bench<> shaken(Bench<>::usual(), false);
  shaken.script.u = {0.1, 0.0};
  EXPECT_THAT(list(shaken.step().u_lin), near(0.1, 0.0)) << "not armed yet";
  EXPECT_THAT(list(shaken.step().u_lin), near(0.1 + 0.15, 0.15)) << "0.3 at the first wheel";
  Bench<> quiet;
  quiet.script.u = {0.1, 0.0};
  quiet.step();
  EXPECT_THAT(list(quiet.step().u_lin), near(0.1, 0.0));
}

TEST(Pipeline, TheShakesAnswerIsHeldAgainstTheDutyInTheWheelsSense) {
  struct Case {
    Vec<2> encoder_sign;
    std::uint32_t reasons;
  };
  for (const Case& c : {Case{{1.0, 1.0}, 0}, Case{{1.0, -1.0}, kEncoderSign | kWheelTwo},
                        Case{{-1.0, 1.0}, kEncoderSign | kWheelOne}}) {
    auto p = Bench<>::usual();
    p.calibration.motor_sign = {1.0, -1.0, 1.0, 1.0};
    Bench<> b(p, false);
    Vec<2> rate = Vec<2>::Zero();
    auto t = b.step();
    for (int i = 0; i < 50 && t.arm_state == ArmState::kArmed; ++i) {
      rate = 0.75 * (rate + Vec<2>(t.motors.duty[0], -t.motors.duty[1]));
      b.raw.encoder_counts[0] += 20.0 * c.encoder_sign(0) * rate(0);
      b.raw.encoder_counts[1] += 20.0 * c.encoder_sign(1) * rate(1);
      t = b.step();
    }
    EXPECT_EQ(t.reasons, c.reasons);
  }
}

}  // namespace
}  // namespace equipoise
