// Degraded modes: a setpoint within their limits.
#include "equipoise/actuate/degraded.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

TEST(Degraded, EveryBitHasARowAndExcludedSensorsAreSome) {
  EXPECT_EQ(kGyroBiasJumped, 1U << (kDegradedModes.size() - 1));
  EXPECT_EQ(kSensorsLeftOut, 0xF8U);
  EXPECT_EQ(kWithoutImu, 1U);
  EXPECT_EQ(kWithoutEncoders, 2U);
  EXPECT_EQ(kEstimatorInDoubt, 4U);
}

TEST(Degraded, WithoutWhatItBalancesByItStands) {
  Command command;
  command.velocity_W_m_s = Vec2(0.3, -0.4);
  command.yaw_rate_rad_s = -20.0;
  for (const std::uint32_t bit : {kWithoutGyroAxis, kEstimatorInDoubt}) {
    EXPECT_EQ(limited(command, bit).velocity_W_m_s.norm(), 0.0);
    EXPECT_EQ(limited(command, bit).yaw_rate_rad_s, 0.0);
  }
  for (const std::uint32_t bit :
       {kWithoutWheelOne, kWithoutWheelTwo, kWithoutWheelThree, kWithoutWheelFour, kGyroBiasJumped}) {
    EXPECT_NEAR(limited(command, bit).velocity_W_m_s.norm(), 0.1, 1e-12);
    EXPECT_NEAR(limited(command, bit).yaw_rate_rad_s, -2.0 * kPi, 1e-12);
  }
  for (const std::uint32_t bit : {kWithoutImu, kWithoutEncoders}) {
    EXPECT_EQ(limited(command, bit).velocity_W_m_s, command.velocity_W_m_s);
    EXPECT_EQ(limited(command, bit).yaw_rate_rad_s, command.yaw_rate_rad_s);
  }
}

TEST(Degraded, SlowsTheCommandAndKeepsItsDirection) {
  Command fast;
  fast.velocity_W_m_s = Vec2(0.3, -0.4);
  fast.yaw_rate_rad_s = -20.0;
  const Command slow = limited(fast, kWithoutWheelTwo);
  EXPECT_NEAR(slow.velocity_W_m_s.norm(), 0.1, 1e-12);
  EXPECT_NEAR(slow.velocity_W_m_s.x() / slow.velocity_W_m_s.y(), -0.75, 1e-12);
  EXPECT_NEAR(slow.yaw_rate_rad_s, -2.0 * kPi, 1e-12);
}

TEST(Degraded, LeavesASlowCommandAndASoundRobotAlone) {
  Command command;
  command.velocity_W_m_s = Vec2(0.05, 0.0);
  command.yaw_rate_rad_s = 1.0;
  EXPECT_EQ(limited(command, kWithoutWheelOne).velocity_W_m_s, command.velocity_W_m_s);
  command.velocity_W_m_s = Vec2(0.5, 0.0);
  EXPECT_EQ(limited(command, 0U).velocity_W_m_s, command.velocity_W_m_s);
  EXPECT_EQ(limited(command, kEstimatorInDoubt).velocity_W_m_s, Vec2(0.0, 0.0));
  EXPECT_EQ(limited(command, kWithoutImu | kWithoutEncoders).velocity_W_m_s, command.velocity_W_m_s);
}

}  // namespace
}  // namespace equipoise
