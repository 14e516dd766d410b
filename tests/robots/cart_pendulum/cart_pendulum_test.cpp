// The third robot through the production pipeline, loop, simulation, log and replay.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "app/log/replay.hpp"
#include "app/sim/simulate.hpp"
#include "equipoise/runtime/telemetry.hpp"
#include "robots/cart_pendulum/firmware.hpp"

namespace equipoise {
namespace {

std::unique_ptr<const app::ConfiguredRobot> robot(const std::vector<std::string>& set = {}) {
  return type_of<CartPendulumFirmware>().load(config_file<CartPendulumFirmware>(), set);
}

app::Choice choice() {
  app::Choice choice;
  choice.fidelity = "nominal";
  app::complete(type_of<CartPendulumFirmware>(), &choice);
  return choice;
}

app::SimSummary simulate(const app::SimOptions& options, const app::TickObserver& observe,
                         const std::vector<std::string>& set = {}) {
  const std::atomic<bool> never{false};
  return app::simulate(*robot(set), choice(), options, observe, never);
}

TEST(CartPendulum, BalancesAndDrives) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    double travelled_m = 0.0;
    const app::SimSummary s = simulate({{true, 0.1}, 20.0, seed}, [&](const runtime::TickRecord& r) {
      travelled_m = r.truth.position_W_m[0];
    });
    EXPECT_EQ(s.verdict.ended, app::Ended::kFinished) << s.verdict.sentence();
    EXPECT_NEAR(travelled_m, 1.9, 0.2);  // 19 s at 0.1 m/s
    EXPECT_LT(s.controlling.attitude_rmse_rad, 0.02);
  }
}

TEST(CartPendulum, FallsWithoutItsFeedback) {
  const app::SimSummary s = simulate({}, nullptr, {"controller.lean=0.0", "controller.lean_rate=0.0"});
  EXPECT_TRUE(s.verdict.fell()) << s.verdict.sentence();
  EXPECT_NE(s.verdict.reasons & kTilt, 0U);
}

TEST(CartPendulum, ItsLogReplaysBitForBit) {
  const std::string path = testing::TempDir() + "cart-pendulum-" + std::to_string(::getpid()) + ".lcm";
  runtime::TelemetryOptions options;
  options.log_path = path;
  options.wait_when_full = true;
  options.run = app::run_info(*robot(), choice(), 1);
  options.run.backend = "sim";
  {
    runtime::Telemetry telemetry(options);
    (void)simulate({{true, 0.1}, 10.0, 1}, [&](const runtime::TickRecord& r) { telemetry.hand_over(r); });
  }
  app::RunLog log(path);
  const app::Replay replay = app::replay_as(type_of<CartPendulumFirmware>(), log, path);
  EXPECT_EQ(replay.ticks, 2000);
  EXPECT_TRUE(replay.identical()) << "tick " << replay.difference.tick << " " << replay.difference.field;
  std::filesystem::remove(path);
}

TEST(CartPendulum, AnEncoderOfItsFourthWheelIsChecked) {
  const TrialEnd end = run_trial<CartPendulumFirmware>(choice(), 1, 2.0,
                                                       [](RawSample& raw) { raw.encoder_counts[3] *= -1.0; });
  EXPECT_EQ(end.arm_state, ArmState::kFault);
  EXPECT_TRUE(end.reasons & kWheelFour) << end.reasons;
}

}  // namespace
}  // namespace equipoise
