#include "app/log/smoother.hpp"

#include <gtest/gtest.h>

#include <random>

namespace equipoise::app {
namespace {

constexpr double kRadius_m = 0.035;
constexpr double kHeight_m = 0.05;

/// A body on wheels that sways and drives, seen by a biased gyro and a shaken accelerometer; tilt about x.
struct Swaying {
  std::vector<SmootherSample> samples;
  std::vector<double> tilt_rad;

  explicit Swaying(const Vec3& bias_rad_s, double gap_from_s = 1e9) {
    std::mt19937 random(1);
    std::normal_distribution<double> gauss;
    for (int k = 0; k < 2000; ++k) {
      const double t = k * kTickS;
      const double tilt = 0.05 * std::sin(3.0 * t) + 0.01;
      const double rate = 0.15 * std::cos(3.0 * t);
      const double turn = -0.45 * std::sin(3.0 * t);
      const double roll = 2.0 * std::sin(2.0 * t);  // of the wheels, relative
      const double roll_dd = -8.0 * std::sin(2.0 * t);
      const double axle = -kRadius_m * (roll_dd + turn);  // along the floor, y of the yaw frame
      SmootherSample s;
      s.gyro_rad_s =
          Vec3(rate, 0.0, 0.0) + bias_rad_s + 0.005 * Vec3(gauss(random), gauss(random), gauss(random));
      s.accel_m_s2 = Vec3(0.0, std::cos(tilt) * axle + kGravity_m_s2 * std::sin(tilt) - kHeight_m * turn,
                          kGravity_m_s2 * std::cos(tilt) - std::sin(tilt) * axle - kHeight_m * rate * rate) +
                     0.3 * Vec3(gauss(random), gauss(random), gauss(random));
      s.rolling_rad = {roll, 0.0};
      s.imu_ok = t < gap_from_s || t > gap_from_s + 0.05;
      samples.push_back(s);
      tilt_rad.push_back(tilt);
    }
  }

  double error_rad(const Smoothed& smoothed) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < tilt_rad.size(); ++k)
      sum += std::pow(smoothed.tilt_rad[k].x() - tilt_rad[k], 2) / static_cast<double>(tilt_rad.size());
    return std::sqrt(sum);
  }
};

TEST(Smoother, FindsTiltAndBiasOfABodyThatSwaysAndDrives) {
  const Swaying body({0.05, -0.03, 0.02});
  const Smoothed s = smooth(body.samples, kRadius_m, kHeight_m);
  EXPECT_LT(body.error_rad(s), 1.5e-3);  // 0.3 m/s2 over 10 s of 200 Hz: 0.7 mrad; the wheels' band adds
  EXPECT_NEAR(s.bias_rad_s[1000].x(), 0.05, 1e-3);
  EXPECT_NEAR(s.bias_rad_s[1000].y(), -0.03, 1e-3);
}

TEST(Smoother, TakesTheRollingOutOfTheAccelerometer) {
  const Swaying body(Vec3::Zero());
  EXPECT_GT(body.error_rad(smooth(body.samples, 0.0, 0.0)),
            2.0 * body.error_rad(smooth(body.samples, kRadius_m, kHeight_m)));
}

/// Of an accelerometer that is shaken too hard to tell.
TEST(Smoother, ReadsTheBiasWhereTheRobotStands) {
  const Vec3 bias(0.01, -0.02, 0.005);
  Swaying body(bias);
  std::mt19937 random(1);
  std::normal_distribution<double> gauss;
  for (SmootherSample& s : body.samples) s.accel_m_s2 += 10.0 * Vec3(gauss(random), gauss(random), 0.0);
  EXPECT_GT(std::abs(smooth(body.samples, kRadius_m, kHeight_m).bias_rad_s[1500].x() - bias.x()), 5e-4);
  for (std::size_t k = 0; k < 500; ++k) {
    SmootherSample s;
    s.gyro_rad_s = bias + 0.002 * Vec3(gauss(random), gauss(random), gauss(random));
    s.accel_m_s2 = Vec3(0.0, 0.0, kGravity_m_s2);
    s.imu_ok = true;
    body.samples[k] = s;
  }
  const Smoothed found = smooth(body.samples, kRadius_m, kHeight_m);
  EXPECT_LT((found.bias_rad_s[1500] - bias).cwiseAbs().maxCoeff(), 4e-4);
}

/// As a robot does that jumps up: half a second of skids, off by 2 m/s2 on the mean.
TEST(Smoother, TakesLittleFromWhereTheRobotSkids) {
  Swaying body(Vec3::Zero());
  std::mt19937 random(1);
  std::normal_distribution<double> gauss;
  for (std::size_t k = 0; k < 100; ++k) body.samples[k].accel_m_s2.y() += -2.0 + 6.0 * gauss(random);
  body.samples.resize(400);
  body.tilt_rad.resize(400);
  const Smoothed s = smooth(body.samples, kRadius_m, kHeight_m);
  EXPECT_LT(body.error_rad(s), 4e-3);
  EXPECT_LT(std::abs(s.bias_rad_s[200].x()), 4e-3);
  EXPECT_LT(std::sqrt(s.tilt_variance[200].x()), 8e-3);
}

TEST(Smoother, BridgesAGap) {
  const Swaying body(Vec3::Zero(), 5.0);
  EXPECT_LT(body.error_rad(smooth(body.samples, kRadius_m, kHeight_m)), 2e-3);
}

}  // namespace
}  // namespace equipoise::app
