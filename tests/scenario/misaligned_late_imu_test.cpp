// Given an IMU that is misaligned and whose gyro is late, when the robot spins and drives on its own
// sensors, then both robots' default filters hold it. What used to topple them: docs/filter.md.
#include <gtest/gtest.h>

#include "app/sim/simulate.hpp"

namespace equipoise {
namespace {

const std::string kConfigs = std::string(EQUIPOISE_SOURCE_DIR) + "/config/";
const std::atomic<bool> kNever{false};

app::SimOptions drive(double yaw_rate_rad_s, double speed_m_s, std::uint64_t seed) {
  return {{true, speed_m_s, yaw_rate_rad_s}, 30.0, seed};
}

TEST(MisalignedLateImu, MbbrSpinsAndDrives) {
  for (const double yaw_hz : {0.0, 1.0, 3.0}) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      const auto robot = app::load_robot(
          kConfigs + "mbbr.toml", {"world.nominal.disturbance.imu_misalignment_rad=[0.03, -0.03, 0.02]",
                                   "world.nominal.disturbance.imu_low_pass=2"});
      const app::Choice choice{"ekf", "scheduled", "nominal", false};
      const app::SimSummary s =
          app::simulate(*robot, choice, drive(2.0 * kPi * yaw_hz, 0.2, seed), nullptr, kNever);
      EXPECT_FALSE(s.verdict.fell()) << yaw_hz << " Hz, seed " << seed;
      EXPECT_LT(s.controlling.attitude_rmse_rad, 0.006) << yaw_hz << " Hz, seed " << seed;
    }
  }
}

TEST(MisalignedLateImu, MbbrWithRadiiUnlikeTheConfiguredOnes) {
  for (const double yaw_hz : {1.0, 3.0}) {
    const auto robot = app::load_robot(
        kConfigs + "mbbr.toml",
        {"world.nominal.actual.ball_radius_scale=1.02", "world.nominal.actual.wheel_radius_scale=0.98"});
    const app::Choice choice{"ekf", "scheduled", "nominal", false};
    const app::SimSummary s =
        app::simulate(*robot, choice, drive(2.0 * kPi * yaw_hz, 0.2, 1), nullptr, kNever);
    EXPECT_FALSE(s.verdict.fell()) << yaw_hz << " Hz";
    EXPECT_LT(s.controlling.attitude_rmse_rad, 0.005) << yaw_hz << " Hz";
  }
}

TEST(MisalignedLateImu, MipSpinsWithBothControllers) {
  for (const char* controller : {"slc", "lqr"}) {
    for (const double yaw_rad_s : {0.0, 5.0, 10.0}) {
      const auto robot = app::load_robot(
          kConfigs + "edumip.toml", {"world.nominal.disturbance.imu_misalignment_rad=[0.03, -0.03, 0.02]",
                                     "world.nominal.disturbance.imu_low_pass=2"});
      const app::Choice choice{"ekf", controller, "nominal", false};
      const app::SimSummary s = app::simulate(*robot, choice, drive(yaw_rad_s, 0.1, 1), nullptr, kNever);
      EXPECT_FALSE(s.verdict.fell()) << controller << ", " << yaw_rad_s << " rad/s";
      EXPECT_LT(s.controlling.attitude_rmse_rad, 0.006) << controller << ", " << yaw_rad_s << " rad/s";
    }
  }
}

}  // namespace
}  // namespace equipoise
