// Encoders that count nothing: a drive grows until one counts, or they are dead.
#include "equipoise/actuate/encoder_probe.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

using Probe = EncoderProbe<2>;
using Sample = Measurement<2>;

constexpr double kDrive = 0.25;

class EncoderProbeTest : public ::testing::Test {
 protected:
  EncoderProbeTest() { z_.encoders_ok = true; }

  /// The last drive after so many ticks.
  double tick(int times, double turning = 0.0) {
    double drive = 0.0;
    for (int i = 0; i < times; ++i) drive = probe_.update(armed_, z_, turning);
    return drive;
  }
  /// The first sample has nothing before it, so that it counts as one that moved.
  double silent(int ticks, double turning = 0.0) { return tick(1 + ticks, turning); }

  Probe probe_{kDrive};
  Sample z_;
  bool armed_ = true;
};

TEST_F(EncoderProbeTest, WaitsThenGrowsToItsDriveAndNoFurther) {
  EXPECT_EQ(silent(Probe::kPatience), 0.0);
  EXPECT_DOUBLE_EQ(tick(1), kDrive / Probe::kGrows);
  EXPECT_DOUBLE_EQ(tick(1), 2.0 * kDrive / Probe::kGrows);
  EXPECT_DOUBLE_EQ(tick(Probe::kGrows - 2), kDrive);
  EXPECT_DOUBLE_EQ(tick(1), kDrive);
}

TEST_F(EncoderProbeTest, CallsThemDeadAtItsEndWithinHalfASecond) {
  silent(Probe::kTicks - 1);
  EXPECT_FALSE(probe_.dead());
  tick(1);
  EXPECT_TRUE(probe_.dead());
  EXPECT_LT(Probe::kTicks * kTickS, 0.5);
  z_.wheel_angle_rad.x() = 1.0;
  tick(1);
  EXPECT_TRUE(probe_.dead()) << "motors off alone forgives";
  armed_ = false;
  tick(1);
  EXPECT_FALSE(probe_.dead());
}

TEST_F(EncoderProbeTest, ACountOfAnyWheelEndsIt) {
  tick(1);
  for (int wheel : {0, 1}) {
    EXPECT_NE(tick(Probe::kTicks - 1), 0.0);
    z_.wheel_angle_rad(wheel) += 0.003;
    EXPECT_EQ(tick(1), 0.0);
    EXPECT_EQ(tick(Probe::kPatience), 0.0) << "and it waits as long again";
    EXPECT_NE(tick(1), 0.0);
    EXPECT_FALSE(probe_.dead());
    z_.wheel_angle_rad(wheel) += 0.003;
    tick(1);
  }
}

TEST_F(EncoderProbeTest, PushesWhereTheControllerPushesAndDoesNotTurnBack) {
  EXPECT_GT(silent(Probe::kPatience + 1, 0.02), 0.0);
  EXPECT_GT(tick(1, -0.02), 0.0);
  z_.wheel_angle_rad.x() += 0.003;
  tick(1, -0.02);
  EXPECT_LT(tick(Probe::kPatience + 1, -0.02), 0.0);
}

TEST_F(EncoderProbeTest, KnowsNothingWithoutSamplesOrWithMotorsOff) {
  for (const bool lost : {true, false}) {
    silent(Probe::kTicks - 1);
    (lost ? z_.encoders_ok : armed_) = false;
    EXPECT_EQ(tick(2 * Probe::kTicks), 0.0);
    EXPECT_FALSE(probe_.dead());
    z_.encoders_ok = armed_ = true;
    EXPECT_EQ(silent(Probe::kPatience), 0.0) << "from the beginning";
    z_.wheel_angle_rad.x() += 0.003;
    tick(1);
  }
}

TEST_F(EncoderProbeTest, CountsTheTicksThatTheLoopMissed) {
  silent(Probe::kPatience - 3);
  z_.ticks = 4;
  EXPECT_DOUBLE_EQ(tick(1), kDrive / Probe::kGrows);
}

TEST_F(EncoderProbeTest, WithoutADriveTheyAreBelieved) {
  probe_ = Probe(0.0);
  EXPECT_EQ(silent(10 * Probe::kTicks), 0.0);
  EXPECT_FALSE(probe_.dead());
}

}  // namespace
}  // namespace equipoise
