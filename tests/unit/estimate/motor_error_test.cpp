#include "equipoise/estimate/motor_error.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

constexpr double kMemoryS = 1.0;

/// For so many ticks.
void acts(MotorError<2>& error, int ticks, double disturbance, double u) {
  for (int i = 0; i < ticks; ++i) error.update(Vec2(0.0, disturbance), Vec2(0.3, u));
}

TEST(MotorError, ADeadMotorLacksWhatItIsAskedForFromTheFirstTickOn) {
  MotorError<2> error(kMemoryS);
  acts(error, 1, -0.9, 0.9);
  EXPECT_NEAR(error.worst(), 0.9, 1e-9);
}

TEST(MotorError, AMotorThatDiesIsFoundAsTheCommandGrows) {
  MotorError<2> error(kMemoryS);
  acts(error, 400, 0.0, 0.1);
  double u = 0.1;
  for (; u < 0.9; u *= 1.04) acts(error, 1, -0.9 * u, u);  // the robot falls with a time constant of 0.13 s
  EXPECT_GT(error.worst(), 0.75);
}

TEST(MotorError, AWheelThatSlipsForAMomentIsNoDeadMotor) {
  MotorError<2> error(kMemoryS);
  acts(error, 400, -0.2, 0.6);
  acts(error, 30, -0.8, 0.9);
  EXPECT_LT(error.worst(), 0.75);
  acts(error, 200, -0.8, 0.9);
  EXPECT_GT(error.worst(), 0.75);
  acts(error, 1000, -0.1, 0.9);  // and is forgotten
  acts(error, 10, -0.8, 0.9);
  EXPECT_LT(error.worst(), 0.75);
}

TEST(MotorError, AMotorThatTurnsUnaskedIsOneToo) {
  MotorError<2> error(kMemoryS);
  acts(error, 400, 0.0, 0.1);
  acts(error, 10, 0.8, -0.2);
  EXPECT_NEAR(error.worst(), 0.8, 1e-9);
}

TEST(MotorError, WithoutAMemoryTheDisturbanceCounts) {
  MotorError<2> error(0.0);
  acts(error, 400, -0.05, 0.9);
  acts(error, 1, -0.3, 0.9);
  EXPECT_NEAR(error.worst(), 0.3, 1e-9);
  error.reset();
  EXPECT_EQ(error.worst(), 0.0);
}

}  // namespace
}  // namespace equipoise
