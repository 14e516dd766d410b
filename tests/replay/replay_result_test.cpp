// What the replay of a run tells: whether it is identical, what is missing, how it ended, and what another
// tuning would have done.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include "app/text/errors.hpp"
#include "equipoise/runtime/log_parts.hpp"
#include "replay/recorded_run.hpp"
#include "support/config_files.hpp"

namespace equipoise {
namespace {

using runtime::TickRecord;
using testing::HasSubstr;

class ReplayRun : public testing::Test {
 protected:
  static constexpr int kTicks = 1200;

  ReplayRun() : path_(testing::TempDir() + "replay-run-" + std::to_string(::getpid()) + ".lcm") {}
  ~ReplayRun() override { std::filesystem::remove(path_); }

  /// A nominal run that drives; `edit` may spoil a tick on its way to the log, or keep it (false).
  template <class Edit>
  void record(Edit&& edit, const std::optional<runtime::EndRecord>& end = {}) const {
    app::FaultPlan plan;
    plan.phase = app::Phase::kDriving;
    plan.fault_at_tick = 1 << 20;
    plan.end_tick = kTicks;
    const auto robot = app::load_robot(config_file<MbbrFirmware>(), {});
    record_run(*robot, path_, plan, 1, [&](auto& telemetry, const TickRecord& r) {
      TickRecord logged = r;
      logged.has_truth = true;  // wrong by a known tilt
      logged.truth = r.estimate;
      logged.truth.theta_rad[0] += 0.02;
      if (edit(logged)) telemetry.hand_over(logged);
      if (end && r.tick == kTicks - 1) (void)telemetry.finish(*end);
    });
  }
  app::Replay replayed(const app::Beside& beside = {}) const {
    app::RunLog log(path_);
    return app::replay_log(log, path_, beside);
  }

  std::string path_;
};

TEST_F(ReplayRun, OfAWholeLogIsIdenticalAndCountsTheErrorsOfTheSettledRobot) {
  record([](TickRecord&) { return true; });
  const app::Replay r = replayed();
  EXPECT_EQ(r.ticks, kTicks);
  EXPECT_EQ(r.missing, 0);
  EXPECT_EQ(r.incomplete, 0);
  EXPECT_TRUE(r.identical()) << r.difference.field;
  EXPECT_NEAR(static_cast<double>(r.logged.ticks), kTicks - 1000, 1.0);
  EXPECT_NEAR(r.logged.json(1.0)["attitude_rmse_rad"].get<double>(), 0.02 / std::sqrt(2.0), 1e-9);
  EXPECT_EQ(r.other.ticks, 0);
  EXPECT_FALSE(r.retuned);
}

TEST_F(ReplayRun, AnotherEstimatorRunsBeside) {
  record([](TickRecord&) { return true; });
  const app::Replay r = replayed({"ekf13", {}});
  EXPECT_TRUE(r.identical());
  EXPECT_EQ(r.other.ticks, r.logged.ticks);
  EXPECT_NE(r.other.attitude, r.logged.attitude);
}

TEST_F(ReplayRun, AnEstimatorThatIsTheTruthIsNeverWrong) {
  record([](TickRecord&) { return true; });
  app::Replay r = replayed({"truth", {}});
  EXPECT_EQ(r.other.ticks, r.logged.ticks);
  EXPECT_EQ(r.other.attitude, 0.0);
  EXPECT_EQ(r.other.rate, 0.0);
  EXPECT_EQ(r.other.position, 0.0);
  r = replayed({"truth", {"safety.max_fall_rad=0.35"}});
  ASSERT_TRUE(r.retuned);
  EXPECT_EQ(r.retuned->changed.errors.attitude, 0.0);
  EXPECT_GT(r.retuned->recorded.errors.attitude, 0.0);
}

TEST_F(ReplayRun, WithoutTheTruthNoErrorIsCounted) {
  record([](TickRecord& t) {
    t.has_truth = false;
    return true;
  });
  app::Replay r = replayed({"ekf13", {}});
  EXPECT_TRUE(r.identical()) << r.difference.field;
  EXPECT_EQ(r.logged.ticks, 0);
  EXPECT_EQ(r.other.ticks, 0);
  r = replayed({"", {"safety.max_fall_rad=0.35"}});
  EXPECT_TRUE(r.identical()) << r.difference.field;
  EXPECT_GT(r.retuned->difference.ticks, 190);
  EXPECT_EQ(r.retuned->recorded.errors.ticks, 0);
}

TEST_F(ReplayRun, OfALogThatWasCutOffIsJudgedByItsTicks) {
  record([](TickRecord&) { return true; });
  app::Replay r = replayed();
  EXPECT_EQ(r.verdict.ended, app::Ended::kFinished) << r.verdict.sentence();
  EXPECT_NEAR(r.verdict.duration_s, kTicks * kTickS, 0.01);
  record([](TickRecord& t) {
    if (t.tick >= 700) t.truth.theta_rad[1] = 0.7;
    return true;
  });
  r = replayed();
  EXPECT_EQ(r.verdict.ended, app::Ended::kFell) << r.verdict.sentence();
  EXPECT_NEAR(r.verdict.fell_at_s, 700 * kTickS, 0.02);
}

TEST_F(ReplayRun, TheRunsOwnVerdictGoesBeforeThatOfItsTicks) {
  runtime::EndRecord end;
  end.ended = static_cast<std::int32_t>(app::Ended::kInterrupted);
  end.duration_s = 1.25;
  record([](TickRecord&) { return true; }, end);
  const app::Replay r = replayed();
  EXPECT_EQ(r.verdict.ended, app::Ended::kInterrupted);
  EXPECT_EQ(r.verdict.duration_s, 1.25);
}

TEST_F(ReplayRun, WhatTheLogHasLostIsTold) {
  record([](TickRecord&) { return true; });
  std::ifstream file(path_, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::filesystem::resize_file(path_, bytes.rfind("EQUIPOISE_MOTORS"));
  const app::Replay r = replayed();
  EXPECT_EQ(r.ticks, kTicks - 1);
  EXPECT_EQ(r.incomplete, 1);
  EXPECT_EQ(r.damaged_bytes, 28U) << "the head of the message that is cut off";
  EXPECT_EQ(r.missing, 0) << "nobody knows that there was another";
}

TEST_F(ReplayRun, AFolderNamedLikeAPartIsNoPart) {
  record([](TickRecord&) { return true; });
  std::filesystem::create_directory(runtime::log_part(path_, 1));
  const app::Replay r = replayed();
  EXPECT_EQ(r.ticks, kTicks);
  EXPECT_EQ(r.incomplete, 0);
}

TEST_F(ReplayRun, AnotherEstimatorMayGoWithAnotherTuning) {
  record([](TickRecord&) { return true; });
  const app::Replay r = replayed({"ekf13", {"safety.max_fall_rad=0.35"}});
  EXPECT_TRUE(r.identical()) << r.difference.field;
  EXPECT_EQ(r.other.ticks, 0) << "it is the tuning's, and does not run beside";
  ASSERT_TRUE(r.retuned);
  EXPECT_GT(r.retuned->difference.attitude, 0.0);
}

TEST_F(ReplayRun, ALostTickIsMissingAndAChangedNumberADifference) {
  record([](TickRecord& r) { return r.tick != 50 && r.tick != 51; });
  app::Replay r = replayed();
  EXPECT_EQ(r.missing, 2);
  EXPECT_EQ(r.ticks, kTicks - 2);
  EXPECT_FALSE(r.identical());
  record([](TickRecord& t) {
    if (t.tick == 60) t.motors.duty[1] += 1e-12;
    return true;
  });
  r = replayed();
  EXPECT_EQ(r.missing, 0);
  EXPECT_TRUE(r.difference.found);
  EXPECT_EQ(r.difference.tick, 60);
  EXPECT_EQ(r.difference.field, "EQUIPOISE_MOTORS.duty[1]");
  EXPECT_FALSE(r.identical());
}

TEST_F(ReplayRun, ATuningThatIsTheRecordedOneDiffersInNothing) {
  record([](TickRecord&) { return true; });
  const app::Replay r = replayed({"", {"safety.max_fall_rad=0.35"}});
  EXPECT_TRUE(r.identical()) << r.difference.field;
  ASSERT_TRUE(r.retuned);
  EXPECT_GT(r.retuned->difference.ticks, 190);
  EXPECT_EQ(r.retuned->difference.attitude, 0.0);
  EXPECT_EQ(r.retuned->recorded.errors.attitude, r.retuned->changed.errors.attitude);
  EXPECT_GT(r.retuned->recorded.duty_squared, 0.0);
  EXPECT_EQ(r.retuned->recorded.duty_squared, r.retuned->changed.duty_squared);
  EXPECT_EQ(r.retuned->not_armed, 0);
}

TEST_F(ReplayRun, ATuningThatWouldNotHaveArmedSaysWhy) {
  record([](TickRecord&) { return true; });
  const app::Replay r = replayed({"", {"safety.min_battery_V=9.0"}});
  ASSERT_TRUE(r.retuned);
  EXPECT_EQ(r.retuned->not_armed, r.retuned->difference.ticks);
  EXPECT_NE(r.retuned->reasons & kBatteryLow, 0U);
}

TEST_F(ReplayRun, ALogWithoutAWholeTickIsRefused) {
  record([](TickRecord&) { return false; });
  try {
    (void)replayed();
    ADD_FAILURE();
  } catch (const app::InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(path_ + ": holds no whole tick"));
  }
}

}  // namespace
}  // namespace equipoise
