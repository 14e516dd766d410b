// Samples that no motion explains, and axes that are dead.
#include "equipoise/estimate/gross_samples.hpp"

#include <gtest/gtest.h>

#include "robots/mbbr/mbbr.hpp"
#include "robots/mip/mip.hpp"

namespace equipoise {
namespace {

Mbbr::Sample mbbr_sample() {
  Mbbr::Sample z;
  z.accel_B_m_s2.z() = -kGravity_m_s2;
  z.gyro_B_rad_s = Vec3(0.1, 0.2, 0.3);
  z.imu_ok = true;
  return z;
}

Mip::Sample mip_sample() {
  Mip::Sample z;
  z.imu_ok = true;
  z.accel_B_m_s2.z() = -kGravity_m_s2;
  return z;
}

TEST(GrossSamples, AGlitchIsNotUsedThreeAreNoGlitch) {
  GrossSamples gross({true, true, false}, 0.0);
  const Mbbr::Sample z = mbbr_sample();
  Mbbr::Sample odd = z;
  odd.gyro_B_rad_s.z() += 3.1;
  EXPECT_TRUE(gross.without(z, z.gyro_B_rad_s).imu_ok);
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(gross.without(odd, z.gyro_B_rad_s).imu_ok);
  EXPECT_FALSE(gross.left_out());
  const Mbbr::Sample without = gross.without(odd, z.gyro_B_rad_s);
  EXPECT_TRUE(without.imu_ok);
  EXPECT_TRUE(without.gyro_axis_ok[0]);
  EXPECT_FALSE(without.gyro_axis_ok[2]);
  EXPECT_TRUE(gross.left_out());
  EXPECT_TRUE(gross.trusted()) << "the robot balances without its z axis";
  odd.gyro_B_rad_s.x() += 3.1;
  gross.without(odd, z.gyro_B_rad_s);
  EXPECT_FALSE(gross.trusted());
}

TEST(GrossSamples, ARobotOnTwoWheelsMayRockAsFastAsItWill) {
  GrossSamples gross({true, false, false}, 2.0 * kPi);
  Mip::Sample z = mip_sample();
  z.gyro_B_rad_s.y() = 5.0;
  for (int i = 0; i < 20; ++i) {
    const Mip::Sample used = gross.without(z, Vec3::Zero());
    EXPECT_TRUE(used.imu_ok);
    EXPECT_FALSE(used.gyro_axis_ok[1]);
    EXPECT_FALSE(gross.left_out());
  }
}

TEST(GrossSamples, ABlowLeavesOutNoAxisOfTheGyro) {
  GrossSamples gross({true, false, false}, 2.0 * kPi);
  Mip::Sample z = mip_sample();
  z.accel_B_m_s2 *= 6.0;
  for (int i = 0; i < 10; ++i) EXPECT_EQ(gross.without(z, Vec3::Zero()).imu_ok, i >= 3);
  EXPECT_FALSE(gross.left_out());
  EXPECT_TRUE(gross.trusted());
}

TEST(GrossSamples, AnAxisThatRepeatsItsCountsIsDeadWhereTheBodyTurns) {
  GrossSamples gross({true, true, false}, 0.0);
  Mbbr::Sample z = mbbr_sample();
  z.gyro_axis_ok[1] = false;
  for (int i = 0; i < 10; ++i) gross.without(z, z.gyro_B_rad_s + Vec3(0.0, 0.04, 0.0));
  EXPECT_FALSE(gross.left_out());
  for (int i = 0; i < 5; ++i) gross.without(z, z.gyro_B_rad_s + Vec3(0.0, 0.06, 0.0));
  EXPECT_TRUE(gross.left_out());
  EXPECT_FALSE(gross.trusted());
}

TEST(GrossSamples, ARobotThatStandsWithoutADeadAxisGoesOnUnlessItTurnsFast) {
  GrossSamples gross({true, false, false}, 2.0 * kPi);
  Mip::Sample z = mip_sample();
  z.gyro_axis_ok[0] = false;
  for (const double turns_rad_s : {0.0, 6.0, -6.0}) {
    z.gyro_B_rad_s.z() = turns_rad_s;
    for (int i = 0; i < 10; ++i) EXPECT_FALSE(gross.without(z, {0.06, 0.0, turns_rad_s}).gyro_axis_ok[0]);
    EXPECT_TRUE(gross.left_out()) << "it goes slowly";
    EXPECT_TRUE(gross.trusted());
  }
  z.gyro_B_rad_s.z() = -6.5;
  gross.without(z, {0.06, 0.0, -6.5});
  z.gyro_B_rad_s.z() = 0.0;
  gross.without(z, {0.06, 0.0, 0.0});
  EXPECT_FALSE(gross.trusted()) << "its tilt has gone astray while it turned";
  gross.reset();
  gross.without(z, {0.06, 0.0, 0.0});
  EXPECT_TRUE(gross.trusted());
}

}  // namespace
}  // namespace equipoise
