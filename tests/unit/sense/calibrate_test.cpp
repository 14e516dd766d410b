#include "equipoise/sense/calibrate.hpp"

#include <gtest/gtest.h>

#include "equipoise/estimate/rest_tilt.hpp"
#include "equipoise/sense/rotor_speed.hpp"
#include "support/assign.hpp"

namespace equipoise {
namespace {

TEST(Calibrate, AccelerometerAtRestUprightIsGravityDownwards) {
  RawSample raw{};
  assign(raw.accel_counts, {0.0, 0.0, 4096.0});  // a chip at rest reports +1 g of specific force
  const auto z = calibrate<3>(raw, Calibration{});
  EXPECT_NEAR(z.accel_B_m_s2.z(), -9.8, 1e-12);  // [T] (5.26): gravity minus acceleration
  EXPECT_NEAR(z.accel_B_m_s2.head<2>().norm(), 0.0, 1e-12);
}

TEST(Calibrate, CountsBecomeSiUnitsInBodyAxes) {
  Calibration c;
  c.R_BS << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // sensor x is body y
  c.encoder_sign = {1, -1, 1, 1};
  c.gyro_bias_B_rad_s = Vec3(0.0, 0.1, 0.0);
  RawSample raw{};
  assign(raw.gyro_counts, {16.4, 0.0, 0.0});
  assign(raw.encoder_counts, {720.0, 360.0, 0.0, 0.0});
  raw.battery_counts = 1700.0;
  const auto z = calibrate<3>(raw, c);
  EXPECT_NEAR(z.gyro_B_rad_s.y(), kPi / 180.0 - 0.1, 1e-12);
  EXPECT_NEAR(z.wheel_angle_rad(0), 2.0 * kPi, 1e-12);
  EXPECT_NEAR(z.wheel_angle_rad(1), -kPi, 1e-12);
  EXPECT_NEAR(z.battery_V, 1700.0 * 1.8 / 4095.0 * 11.0 - 0.10, 1e-9);
}

TEST(Calibrate, TellsWhichAxesPointBackwards) {
  Mat3 upright;  // the eduMIP's board
  upright << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  EXPECT_EQ(axis_sign(upright), Vec3(1.0, -1.0, 1.0));
  const Mat3 turned = Eigen::AngleAxisd(2.8, Vec3::UnitZ()).toRotationMatrix();
  EXPECT_EQ(axis_sign(turned), Vec3(-1.0, -1.0, 1.0));
}

TEST(Calibrate, AttitudeQuaternionBecomesRollPitchYawOfTheBody) {
  const double half = 0.15;
  RawSample raw{};
  assign(raw.attitude_wxyz, {std::cos(half), 0.0, std::sin(half), 0.0});
  EXPECT_NEAR(calibrate<3>(raw, Calibration{}).attitude_rad.y(), 0.3, 1e-12);
  assign(raw.attitude_wxyz, {0, 0, 0, 0});
  EXPECT_TRUE(calibrate<3>(raw, Calibration{}).attitude_rad.hasNaN());
}

TEST(RotorSpeed, IsTheSlopeOfSixSamplesAndStartsAtRest) {
  RotorSpeed<3> rotor;
  const Vec3 offset(100.0, -50.0, 3.0);
  EXPECT_LT(rotor.update(offset).norm(), 1e-9) << "an encoder that does not start at zero is no speed";
  Vec3 rate;
  for (int k = 1; k <= 6; ++k) rate = rotor.update(offset + k * kTickS * Vec3(10.0, -3.0, 0.5));
  EXPECT_LT((rate - Vec3(10.0, -3.0, 0.5)).norm(), 1e-9);
}

TEST(RotorSpeed, WeightsAreThePrintedOnes) {
  RotorSpeed<1> rotor;
  rotor.update(Vec<1>::Zero());
  EXPECT_NEAR(rotor.update(Vec<1>::Ones())(0), 28.6, 0.05);  // [T] (6.20)
  EXPECT_NEAR(rotor.update(Vec<1>::Zero())(0), 17.1, 0.05);
  EXPECT_NEAR(rotor.update(Vec<1>::Zero())(0), 5.71, 0.005);
}

TEST(RestTilt, FindsRollAndPitchFromGravity) {
  RestTilt rest;
  const double roll = 0.1;
  const double pitch = -0.2;
  // R^T (0, 0, -g) for R = Ry(pitch) Rx(roll)
  const Vec3 y(std::sin(pitch), -std::sin(roll) * std::cos(pitch), -std::cos(roll) * std::cos(pitch));
  const Vec2 tilt = rest.update(9.8 * y);
  EXPECT_NEAR(tilt.x(), roll, 1e-12);
  EXPECT_NEAR(tilt.y(), pitch, 1e-12);
  EXPECT_TRUE(rest.update(Vec3::Constant(std::nan(""))).isApprox(tilt)) << "a NaN does not stick";
  EXPECT_EQ(rest.update(Vec3(60.0, -20.0, 70.0)), tilt) << "garbage";
}

}  // namespace
}  // namespace equipoise
