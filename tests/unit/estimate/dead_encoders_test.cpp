// Two encoders that stand still: dead, or held by stiction.
#include "equipoise/estimate/dead_encoders.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

const Vec3 kYawFromWheels(-0.25, -0.25, -0.25);

struct Motion {
  Vec3 gyro_rad_s = Vec3::Zero();
  Vec3 wheels_rad_s = Vec3::Zero();
};

/// Ticks until any encoder is called dead; 0: none.
int found(const Motion& motion, int lost = -1, int ticks = 400) {
  DeadEncoders<3> watch(kYawFromWheels);
  Measurement<3> z;
  z.imu_ok = z.encoders_ok = true;
  z.gyro_B_rad_s = motion.gyro_rad_s;
  for (int i = 1; i <= ticks; ++i) {
    z.wheel_angle_rad += kTickS * motion.wheels_rad_s;
    watch.update(z, lost);
    if (watch.dead() != 0) return i;
  }
  return 0;
}

TEST(DeadEncoders, WheelsOfARobotThatStandsStillMayStandStill) {
  EXPECT_EQ(found({Vec3::Zero(), Vec3::Zero()}), 0);
  EXPECT_EQ(found({Vec3(0.02, -0.02, 0.05), Vec3::Zero()}), 0);
}

TEST(DeadEncoders, ABodyThatTurnsTurnsItsWheels) {
  EXPECT_EQ(found({Vec3(0.5, 0.0, 0.0), Vec3::Zero()}), 49);  // 0.08 rad, from the second sample on
  EXPECT_EQ(found({Vec3(0.0, -0.5, 0.0), Vec3::Zero()}), 49);
  EXPECT_EQ(found({Vec3(0.0, 0.0, 6.3), Vec3::Zero()}), 6);
}

TEST(DeadEncoders, OneAloneIsNotItsBusiness) {
  EXPECT_EQ(found({Vec3(0.5, 0.0, 6.3), Vec3(5.0, 0.0, 5.0)}), 0);
}

TEST(DeadEncoders, TheThirdWheelDoesNotTurnAlone) {
  EXPECT_EQ(found({Vec3::Zero(), Vec3(0.0, 0.0, 5.1)}), 22);  // 0.13 rad of yaw that is not there
  // One of the two is known to be dead: the other may stand still for a second.
  EXPECT_EQ(found({Vec3::Zero(), Vec3(0.0, 0.0, 5.1)}, 0), 222);
  EXPECT_EQ(found({Vec3::Zero(), Vec3(0.0, 0.0, 1.7)}, 0), 237);  // 2 rad
  EXPECT_EQ(found({Vec3::Zero(), Vec3(0.0, 0.0, 1.0)}, 0, 390), 0);
}

TEST(DeadEncoders, InATurnWhoseDriveCancelsItAtTwoWheelsTheThirdTurnsAlone) {
  EXPECT_EQ(found({Vec3(0.0, 0.0, -4.0), Vec3(16.0, 0.0, 0.0)}, -1, 40), 0);
  EXPECT_EQ(found({Vec3(0.0, 0.0, -4.0), Vec3(16.0, 0.0, 0.0)}), 42);  // not for long
  EXPECT_NE(found({Vec3(0.0, 0.0, -12.0), Vec3(16.0, 0.0, 0.0)}), 0);  // a third of the turn: two are dead
}

TEST(DeadEncoders, BesideALostOneAWheelMayStandStillInATurnForAWhile) {
  EXPECT_EQ(found({Vec3(0.0, 0.0, 6.3), Vec3(0.0, 0.0, 5.0)}, 0, 30), 0);
  EXPECT_EQ(found({Vec3(0.5, 0.0, 0.0), Vec3(0.0, 0.0, 5.0)}, 0), 49);  // but the body does not tip
}

TEST(DeadEncoders, ACountStartsTheWatchAnew) {
  DeadEncoders<3> watch(kYawFromWheels);
  Measurement<3> z;
  z.imu_ok = z.encoders_ok = true;
  z.gyro_B_rad_s = Vec3(0.5, 0.0, 0.0);
  for (int i = 1; i <= 400; ++i) {
    if (i % 20 == 0) z.wheel_angle_rad += Vec3(0.01, 0.01, 0.01);
    watch.update(z, -1);
  }
  EXPECT_EQ(watch.dead(), 0U);
}

TEST(DeadEncoders, NamesBoth) {
  DeadEncoders<3> watch(kYawFromWheels);
  Measurement<3> z;
  z.imu_ok = z.encoders_ok = true;
  z.gyro_B_rad_s = Vec3(0.0, 0.0, 6.3);
  for (int i = 0; i < 20; ++i) {
    z.wheel_angle_rad.y() += 0.1;
    watch.update(z, -1);
  }
  EXPECT_EQ(watch.dead(), 5U);
  watch.reset();
  EXPECT_EQ(watch.dead(), 0U);
}

}  // namespace
}  // namespace equipoise
