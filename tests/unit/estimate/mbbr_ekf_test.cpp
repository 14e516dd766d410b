#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "robots/mbbr/config.hpp"
#include "robots/mbbr/ekf.hpp"

namespace equipoise {
namespace {

using Model = MbbrEkfModel;

/// A robot that stands upright and turns evenly, seen by a misaligned IMU beside its axis.
struct Turning {
  MbbrConfig config;
  Vec2 mount{0.02, -0.03};
  Vec3 bias{0.004, -0.003, 0.002};
  Vec2 lever{0.03, -0.02};
  double rate_rad_s = 2.0 * kPi;
  double age_s = 0.0;
  double wheel_scale = 0.0;  // the wheels turn by so much more than configured

  Turning() : config(load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", {}).config) {
    config.robot.l_a.head<2>() = lever;
  }

  MbbrEkf filter() const {
    MbbrEkf::Params p = config.estimators.ekf;
    p.sensor_age_s = age_s;
    return {config.robot, p};
  }

  Mbbr::Sample at(double t_s) const {
    const Mat3 R_mount =
        Eigen::AngleAxisd(mount.norm(), Vec3(mount.x(), mount.y(), 0.0).normalized()).toRotationMatrix();
    const Vec3 accel(rate_rad_s * rate_rad_s * lever.x(), rate_rad_s * rate_rad_s * lever.y(),
                     -kGravity_m_s2);
    Mbbr::Sample z;
    z.gyro_B_rad_s = R_mount.transpose() * Vec3(0.0, 0.0, rate_rad_s) + bias;
    z.accel_B_m_s2 = R_mount.transpose() * accel;
    z.wheel_angle_rad = (1.0 + wheel_scale) *
                        MbbrKinematics(config.robot).wheels_from_ball(Vec3(0.0, 0.0, -rate_rad_s * t_s));
    z.imu_ok = z.encoders_ok = true;
    return z;
  }

  /// Holds the rate against back-EMF and viscous friction.
  Vec3 input() const {
    return {0.0, 0.0, -(config.robot.k2_ball + config.robot.mu_v) / config.robot.k1 * rate_rad_s};
  }

  MbbrEkf after(double duration_s) const {
    MbbrEkf filter = this->filter();
    filter.start(Vec2::Zero(), Vec3(0.0, 0.0, bias.z()), at(0.0).wheel_angle_rad);
    for (int k = 1; k <= static_cast<int>(duration_s * kTickHz); ++k) {
      filter.predict(input());
      filter.update(at(k * kTickS));
    }
    return filter;
  }
};

TEST(MbbrEkf, TakesTheYawGyrosBiasOffThatItWasStartedWith) {
  Turning standing;
  standing.rate_rad_s = 0.0;
  standing.bias = Vec3(0.0, 0.0, 0.02);
  EXPECT_NEAR(standing.after(10.0).estimate().theta_dot.z(), 0.0, 1e-3);
  Turning turning;
  turning.bias.z() = 0.05;
  EXPECT_NEAR(turning.after(10.0).estimate().theta_dot.z(), turning.rate_rad_s, 0.005);
}

TEST(MbbrEkf, FindsACrookedMountWhileTurning) {
  const MbbrEkf filter = Turning().after(20.0);
  const MbbrEstimate x = filter.estimate();
  EXPECT_LT((filter.x().segment<2>(Model::kMountX) - Turning().mount).norm(), 0.003);
  EXPECT_LT(x.theta_xy.norm(), 0.003);
  EXPECT_LT(x.phi_dot_star.norm(), 0.02);
  EXPECT_NEAR(x.theta_dot.z(), 2.0 * kPi, 0.003);
  EXPECT_LT(x.normalized_innovation, 0.5);
}

TEST(MbbrEkf, FindsRadiiUnlikeTheConfiguredOnesWhileTurning) {
  for (const double rate_hz : {1.0, 3.0}) {
    Turning robot;
    robot.rate_rad_s = 2.0 * kPi * rate_hz;
    robot.wheel_scale = 0.03;
    const MbbrEkf filter = robot.after(20.0);
    const MbbrEstimate x = filter.estimate();
    EXPECT_NEAR(filter.x()(Model::kWheelScale), 0.03, 0.001) << rate_hz;
    EXPECT_LT((filter.x().segment<2>(Model::kMountX) - robot.mount).norm(), 0.003) << rate_hz;
    EXPECT_LT(x.theta_xy.norm(), 0.003) << rate_hz;
    EXPECT_NEAR(x.theta_dot.z(), robot.rate_rad_s, 0.005) << rate_hz;
    EXPECT_NEAR(
        filter.wheel_rate_rad_s().x(),
        1.03 * MbbrKinematics(robot.config.robot).wheels_from_ball(Vec3(0.0, 0.0, -robot.rate_rad_s)).x(),
        0.02)
        << rate_hz;
  }
}

TEST(MbbrEkf, WhatNoRadiusExplainsIsSlip) {
  for (const Precision precision : {Precision::kSingle, Precision::kDouble}) {
    Turning robot;
    robot.wheel_scale = 0.2;
    robot.config.estimators.ekf.precision = precision;
    const MbbrEkf filter = robot.after(20.0);
    const double sigma = std::sqrt(robot.config.estimators.ekf.filter.initial_variance(Model::kWheelScale));
    EXPECT_NEAR(filter.x()(Model::kWheelScale), 3.0 * sigma, 1e-6);
    EXPECT_NEAR(filter.estimate().theta_dot.z(), robot.rate_rad_s, 0.02);
  }
}

TEST(MbbrEkf, HeadingIsOfTheTickWhateverTheSensorsAge) {
  for (const double age_s : {0.0, 0.0039, 0.0075}) {
    Turning slow;
    slow.age_s = age_s;
    slow.mount.setZero();
    const double later = slow.after(1.0).estimate().theta_z - slow.after(0.995).estimate().theta_z;
    EXPECT_NEAR(later, kTickS * 2.0 * kPi, 1e-3) << age_s;
    EXPECT_NEAR(slow.after(20.0).estimate().theta_z - slow.after(19.0).estimate().theta_z, 2.0 * kPi, 2e-3);
  }
}

TEST(MbbrEkf, DoesWithoutAWheelThatLies) {
  const Turning robot;
  MbbrEkf filter = robot.after(5.0);
  for (int k = 1; k <= 200; ++k) {
    Mbbr::Sample z = robot.at(5.0 + k * kTickS);
    z.wheel_angle_rad.x() = -40.0;  // stuck
    z.wheel_ok[0] = false;
    filter.predict(robot.input());
    filter.update(z);
    ASSERT_EQ(filter.row_nis()[Model::kWheel], 0.0);
  }
  const MbbrEstimate x = filter.estimate();
  EXPECT_LT(x.theta_xy.norm(), 0.005);
  EXPECT_LT(x.phi_dot_star.norm(), 0.1);
  EXPECT_NEAR(filter.wheel_rate_rad_s().x(),
              MbbrKinematics(robot.config.robot).wheels_from_ball(Vec3(0.0, 0.0, -robot.rate_rad_s)).x(),
              0.3);
}

TEST(MbbrEkf, PredictsMissedTicksAndDoubtsMoreWithEachOne) {
  const Turning robot;
  MbbrEkf filter = robot.after(5.0);
  const double heading = filter.estimate().theta_z;
  double sigma = filter.tilt_sigma_rad();
  for (int k = 0; k < 20; ++k) {
    filter.predict(robot.input());
    EXPECT_GT(filter.tilt_sigma_rad(), sigma);
    sigma = filter.tilt_sigma_rad();
  }
  EXPECT_NEAR(filter.estimate().theta_z - heading, 20 * kTickS * robot.rate_rad_s, 0.01);
  EXPECT_LT(filter.estimate().theta_xy.norm(), 0.02);
}

TEST(MbbrEkf, SkipsADeadGyroAxisAlone) {
  const Turning robot;
  MbbrEkf filter = robot.after(5.0);
  Mbbr::Sample z = robot.at(5.005);
  z.gyro_B_rad_s.x() = 7.0;
  z.gyro_axis_ok[0] = false;
  filter.predict(robot.input());
  filter.update(z);
  EXPECT_EQ(filter.row_nis()[0], 0.0);
  EXPECT_GT(filter.row_nis()[1], 0.0);
  EXPECT_LT(filter.estimate().normalized_innovation, 0.5);
}

TEST(MbbrEkf, OnlyTheAccelerometerFeelsAPush) {
  const Turning robot;
  const MbbrEkf settled = robot.after(5.0);
  // Of the ball's rates, a tick after samples that are off by so much.
  const auto doubt = [&](const Vec3& gyro_rad_s, const Vec3& accel_m_s2, double wheel_rad = 0.0) {
    MbbrEkf filter = settled;
    filter.predict(robot.input());
    Mbbr::Sample z = robot.at(5.005);
    z.gyro_B_rad_s += gyro_rad_s;
    z.accel_B_m_s2 += accel_m_s2;
    z.wheel_angle_rad.x() += wheel_rad;
    filter.update(z);
    filter.predict(robot.input());
    return filter.P()(Model::kPhiDotX, Model::kPhiDotX);
  };
  const double usual = doubt(Vec3::Zero(), Vec3::Zero());
  EXPECT_NEAR(doubt({0.0, 0.0, 3.0}, Vec3::Zero()), usual, 0.01 * usual);  // the ball turns on the floor
  EXPECT_NEAR(doubt({1.5, 0.0, 0.0}, Vec3::Zero()), usual, 0.01 * usual);  // it shakes
  EXPECT_NEAR(doubt(Vec3::Zero(), {3.0, 0.0, 0.0}), usual, 0.01 * usual);  // and rolls over a joint
  EXPECT_GT(doubt(Vec3::Zero(), {12.0, 0.0, 0.0}), usual + 0.4);
  EXPECT_GT(doubt(Vec3::Zero(), {24.0, 0.0, 0.0}), usual + 4.0 * 0.4);  // twice the force
  const double slipping = doubt(Vec3::Zero(), Vec3::Zero(), 0.5);
  EXPECT_NEAR(doubt(Vec3::Zero(), {12.0, 0.0, 0.0}, 0.5), slipping, 0.01 * slipping);
}

TEST(MbbrEkf, SurprisingRowHasALargeInnovation) {
  const Turning robot;
  MbbrEkf filter = robot.after(5.0);
  Mbbr::Sample z = robot.at(5.005);
  z.wheel_angle_rad.y() += 0.5;
  filter.predict(robot.input());
  filter.update(z);
  EXPECT_GT(filter.row_nis()[Model::kWheel + 1], 9.0);
}

}  // namespace
}  // namespace equipoise
