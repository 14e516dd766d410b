// Robots as built along every named path, and robots whose wheels slip under hard starts.
#include <gtest/gtest.h>

#include <atomic>
#include <string>

#include "app/sim/sim_job.hpp"
#include "support/config_files.hpp"

namespace equipoise {
namespace {

app::SimSummary driven(const std::string& config, app::SimRequest request) {
  request.config = config;
  request.choice.fidelity = "built2025";
  const auto robot = app::load_for(&request);
  const std::atomic<bool> stop{false};
  return app::simulate(*robot, request.choice, app::options_for(request, *robot), {}, stop);
}

class OnPath : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, OnPath, testing::Values("circle", "figure8", "square", "waltz"));

void expect_follows(const std::string& config, const char* path, double off_m) {
  for (const std::int64_t robot : {0, 1, 2}) {
    app::SimRequest request;
    request.robot = robot;
    request.path = path;
    const app::SimSummary s = driven(config, request);
    EXPECT_FALSE(s.verdict.fell()) << "robot " << robot;
    EXPECT_LT(s.path_rmse_m, off_m) << "robot " << robot;
  }
}

TEST_P(OnPath, TheBallBalancerGoes) { expect_follows(config_file<MbbrFirmware>(), GetParam(), 0.12); }
TEST_P(OnPath, TheMipGoes) { expect_follows(config_file<MipFirmware>(), GetParam(), 0.12); }

TEST(SlippingWheels, StartsAreGentleEnoughForMostRobots) {
  int upright = 0;
  for (std::int64_t robot = 1; robot <= 10; ++robot) {
    for (const double yaw_hz : {0.0, 1.0}) {
      app::SimRequest request;
      request.robot = robot;
      request.set = {"population.disturbance.wheel_grip=[0.6, 1.0]"};
      request.yaw_rate_rad_s = 2.0 * kPi * yaw_hz;
      request.drive_mps = 0.2;
      request.duration_s = 5.0;
      upright += driven(config_file<MbbrFirmware>(), request).verdict.fell() ? 0 : 1;
    }
  }
  EXPECT_GE(upright, 17);
}

}  // namespace
}  // namespace equipoise
