// A gyro that lies for a while and is sound again: what the estimator made of the lie must not outlive it.
#include <gtest/gtest.h>

#include <string>

#include "app/evaluate/fault_run.hpp"
#include "robots/mbbr/firmware.hpp"
#include "support/config_files.hpp"

namespace equipoise {
namespace {

struct Lie {
  const char* name;
  app::FaultKind kind;
  int ticks;
};

class Ends : public testing::TestWithParam<Lie> {};

TEST_P(Ends, AndTheRobotDrivesOn) {
  using Firmware = MbbrFirmware;
  app::Choice choice;
  choice.estimator = Firmware::kDefaultEstimator;
  choice.controller = Firmware::kDefaultController;
  choice.fidelity = "nominal";
  const auto robot = app::load_robot(config_file<Firmware>(), {});
  const Lie& lie = GetParam();
  app::FaultPlan plan;
  plan.phase = app::Phase::kDriving;
  plan.fault = lie.kind;
  plan.fault_at_tick = 800;
  plan.fault_ticks = lie.ticks;
  plan.end_tick = 2000;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const app::FaultOutcome outcome = app::run_with_fault(*robot, choice, plan, seed);
    EXPECT_FALSE(outcome.unsafe) << outcome.why << ", seed " << seed;
    EXPECT_TRUE(outcome.upright) << "seed " << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(Lies, Ends,
                         testing::Values(Lie{"ramp", app::FaultKind::kGyroRamp, 165},
                                         Lie{"jump", app::FaultKind::kBiasJump, 11}),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace equipoise
