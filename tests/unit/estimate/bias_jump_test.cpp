// A gyro bias that jumps, and what only looks like it.
#include "equipoise/estimate/bias_jump.hpp"

#include <gtest/gtest.h>

#include <functional>

namespace equipoise {
namespace {

const Vec3 kJump(0.2, -0.2, 0.2);
const Vec3 kSigma(0.045, 0.045, 0.18);

struct Case {
  std::function<Vec3(int)> gyro = [](int) { return kJump; };  // tick of the examination, from 0
  Vec3 before = Vec3::Zero();
  Vec3 jump = kJump;
  Vec3 by_wheels = Vec3::Zero();
  double accel_nis = 2.0;
};

/// Samples that were kept from the filter.
int examine(BiasJump& bias, const Case& c) {
  int kept = 0;
  for (int i = 0; i < BiasJump::kTicks; ++i) {
    if (!bias.examine(c.gyro(i), c.before, c.jump, kSigma, [&] { return c.by_wheels; })) break;
    ++kept;
    bias.feel(c.accel_nis);
  }
  return kept;
}

TEST(BiasJumpTest, IsKnownAfterFourSamplesThatTheFilterDoesNotSee) {
  BiasJump bias;
  EXPECT_EQ(examine(bias, {}), BiasJump::kTicks);
  EXPECT_EQ(bias.bias_rad_s(), kJump);
  EXPECT_EQ(bias.jumps(), 1);
  EXPECT_FALSE(bias.examining());
}

TEST(BiasJumpTest, BackAndForthAddUp) {
  BiasJump bias;
  examine(bias, {});
  Case back;
  back.gyro = [](int) { return Vec3(-kJump); };
  back.jump = -kJump;
  examine(bias, back);
  EXPECT_LT(bias.bias_rad_s().norm(), 1e-12);
  EXPECT_EQ(bias.jumps(), 2);
}

TEST(BiasJumpTest, TheRobotMayMoveMeanwhileAsItsWheelsSay) {
  Case c;
  c.gyro = [](int i) { return Vec3(kJump + 0.05 * (i + 1) * Vec3(1.0, 1.0, 0.0)); };
  c.by_wheels = Vec3(0.15, 0.15, 0.0);
  BiasJump bias;
  EXPECT_EQ(examine(bias, c), BiasJump::kTicks);
  EXPECT_EQ(bias.bias_rad_s(), kJump);
}

TEST(BiasJumpTest, WhatTheWheelsTurnedWithIsNone) {
  Case c;
  c.gyro = [](int i) { return Vec3((1.0 + 0.1 * i) * kJump); };
  c.by_wheels = kJump;
  BiasJump bias;
  EXPECT_EQ(examine(bias, c), BiasJump::kTicks - 1);
  EXPECT_EQ(bias.jumps(), 0);
}

TEST(BiasJumpTest, WhatTheWheelsNearlyExplainIsNone) {
  Case c;
  const Vec3 jump(0.2, 0.0, 0.0);
  c.jump = jump;
  c.gyro = [&](int i) { return Vec3((1.2 + 0.1 * i) * jump); };
  BiasJump bias;
  c.by_wheels = Vec3(0.25, 0.0, 0.0);  // 0.15 rad/s less than the gyro, 3.3 sigma
  examine(bias, c);
  EXPECT_EQ(bias.jumps(), 0);
  c.by_wheels = Vec3(0.05, 0.0, 0.0);  // 5.1 sigma
  examine(bias, c);
  EXPECT_EQ(bias.jumps(), 1);
}

TEST(BiasJumpTest, WhatGrowsOnIsNone) {
  Case c;
  c.gyro = [](int i) { return Vec3((1.0 + 0.3 * i) * kJump); };
  BiasJump bias;
  examine(bias, c);
  EXPECT_EQ(bias.jumps(), 0);
}

TEST(BiasJumpTest, OneBadSampleIsNone) {
  Case c;
  c.gyro = [](int i) { return i == 0 ? kJump : Vec3(Vec3::Zero()); };
  BiasJump bias;
  examine(bias, c);
  EXPECT_EQ(bias.bias_rad_s(), Vec3(Vec3::Zero()));
}

TEST(BiasJumpTest, AKnockThatTheAccelerometerFeelsIsNone) {
  Case c;
  c.accel_nis = 19.0;
  BiasJump bias;
  examine(bias, c);
  EXPECT_EQ(bias.jumps(), 1);
  c.accel_nis = 21.0;
  examine(bias, c);
  EXPECT_EQ(bias.jumps(), 1);
}

TEST(BiasJumpTest, WhereTheModelAloneJumpsNothingIsExamined) {
  Case c;
  c.gyro = [](int) { return Vec3(Vec3::Zero()); };  // expected to turn, and does not
  BiasJump bias;
  EXPECT_EQ(examine(bias, c), 0);
}

TEST(BiasJumpTest, ALargeOneIsSomethingElse) {
  Case c;
  c.jump = Vec3(0.69, 0.0, 0.0);
  c.gyro = [&c](int) { return c.jump; };
  BiasJump bias;
  EXPECT_EQ(examine(bias, c), BiasJump::kTicks);
  c.jump = Vec3(0.71, 0.0, 0.0);
  EXPECT_EQ(examine(bias, c), 0);
}

TEST(BiasJumpTest, DroppedItBeginsAnew) {
  BiasJump bias;
  ASSERT_TRUE(bias.examine(kJump, Vec3::Zero(), kJump, kSigma, [] { return Vec3(Vec3::Zero()); }));
  bias.drop();
  EXPECT_FALSE(bias.examining());
  EXPECT_EQ(examine(bias, {}), BiasJump::kTicks);
  EXPECT_EQ(bias.jumps(), 1);
}

}  // namespace
}  // namespace equipoise
