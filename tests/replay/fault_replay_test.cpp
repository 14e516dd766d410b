// Runs in which the runtime intervened (overrun, failing write, old command, full log) replay bit for bit:
// the log holds everything the tick saw.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "replay/recorded_run.hpp"
#include "robots/robots.hpp"

namespace equipoise {
namespace {

using app::FaultKind;

constexpr FaultKind kInterventions[] = {FaultKind::kStall20ms, FaultKind::kStall50ms, FaultKind::kWriteError,
                                        FaultKind::kRemoteLost, FaultKind::kLogFull};
constexpr std::uint64_t kSeeds = 8;  // 40 runs per robot

struct Recorded {
  std::uint32_t inhibit = 0;  // all bits that were raised
  double oldest_command_s = 0.0;
};

Recorded record(const app::ConfiguredRobot& robot, const std::string& path, FaultKind fault, app::Phase phase,
                std::uint64_t seed) {
  app::FaultPlan plan;
  plan.phase = phase;
  plan.fault = fault;
  plan.fault_at_tick = phase == app::Phase::kArming ? 60 : 400 + 7 * static_cast<int>(seed);
  plan.fault_ticks = 150;
  plan.end_tick = 800;
  Recorded out;
  record_run(robot, path, plan, seed, [&](auto& telemetry, const runtime::TickRecord& r) {
    telemetry.hand_over(r);
    out.inhibit |= r.inhibit;
    out.oldest_command_s = std::max(out.oldest_command_s, r.command_age_s);
  });
  return out;
}

template <class Firmware>
class FaultReplay : public testing::Test {};
TYPED_TEST_SUITE(FaultReplay, TestRobots);

TYPED_TEST(FaultReplay, IsBitExactWhereTheRuntimeIntervened) {
  const std::string path =
      testing::TempDir() + "fault-replay-" + std::to_string(::getpid()) + TypeParam::kName + ".lcm";
  const app::RobotType& type = type_of<TypeParam>();
  const auto robot = type.load(config_file<TypeParam>(), {});
  for (const FaultKind fault : kInterventions) {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      SCOPED_TRACE(std::string(app::kFaults[static_cast<std::size_t>(fault)].name) + " seed " +
                   std::to_string(seed));
      // Before arming, and in each phase after it.
      const auto phase = static_cast<app::Phase>(1 + seed % 4);
      const Recorded recorded = record(*robot, path, fault, phase, seed);
      if (fault == FaultKind::kRemoteLost) {
        EXPECT_GT(recorded.oldest_command_s, 0.5);
      } else {
        EXPECT_NE(recorded.inhibit, 0U) << "the runtime did not intervene";
      }
      app::RunLog log(path);
      const app::Replay replay = app::replay_as(type, log, path);
      EXPECT_GE(replay.ticks, 780);
      EXPECT_TRUE(replay.identical()) << "tick " << replay.difference.tick << " " << replay.difference.field;
    }
  }
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace equipoise
