// What a replay tells: the first number that differs, errors against the truth, ticks that are missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "app/cli/errors.hpp"
#include "replay/recorded_run.hpp"

namespace equipoise {
namespace {

using app::Difference;
using runtime::TickRecord;
using testing::HasSubstr;

TEST(ReplayErrors, AreRootMeanSquares) {
  app::ReplayErrors errors;
  EXPECT_TRUE(errors.json(0.1).is_null());
  runtime::StateRecord truth{};
  runtime::StateRecord x{};
  x.theta_rad[0] = 0.03;
  x.theta_rad[1] = -0.04;
  x.theta_rad[2] = 9.0;  // yaw has no say
  x.phi_dot_rad_s[0] = 3.0;
  x.position_W_m[0] = 0.3;
  x.position_W_m[1] = 0.4;
  errors.add(x, truth);
  errors.add(truth, truth);
  const auto json = errors.json(0.1);
  EXPECT_EQ(json["ticks"], 2);
  EXPECT_NEAR(json["attitude_rmse_rad"].get<double>(), 0.05 / 2.0, 1e-12);
  EXPECT_NEAR(json["rolling_rate_rmse_rad_s"].get<double>(), 1.5, 1e-12);
  EXPECT_NEAR(json["rolling_speed_rmse_m_s"].get<double>(), 0.15, 1e-12);
  EXPECT_NEAR(json["position_rmse_m"].get<double>(), 0.5 / std::sqrt(2.0), 1e-12);
}

TEST(ReplayErrors, OfATuningAreMeansOverItsTicks) {
  app::Retuned::Figures figures;
  EXPECT_TRUE(figures.json(0, 0.1).is_null());
  figures.duty_squared = 1.0;
  figures.innovation = 6.0;
  figures.saturated = 3;
  const auto json = figures.json(4, 0.1);
  EXPECT_DOUBLE_EQ(json["duty_rms"], 0.5);
  EXPECT_DOUBLE_EQ(json["normalized_innovation_mean"], 1.5);
  EXPECT_DOUBLE_EQ(json["saturated_fraction"], 0.75);
  EXPECT_TRUE(json["errors"].is_null());
}

Difference compared(const TickRecord& logged, const TickRecord& replayed) {
  Difference d;
  app::compare(logged, replayed, &d);
  return d;
}

TEST(Compare, FindsTheFirstNumberThatDiffersInAnyBit) {
  TickRecord logged{};
  logged.tick = 7;
  TickRecord replayed = logged;
  EXPECT_FALSE(compared(logged, replayed).found);
  replayed.estimate.theta_rad[1] = std::numeric_limits<double>::denorm_min();
  replayed.duty[0] = 1.0;
  const Difference d = compared(logged, replayed);
  EXPECT_TRUE(d.found);
  EXPECT_EQ(d.tick, 7);
  EXPECT_EQ(d.field, "EQUIPOISE_STATE.theta_rad[1]");
  EXPECT_EQ(d.logged, 0.0);
  EXPECT_EQ(d.replayed, std::numeric_limits<double>::denorm_min());
}

TEST(Compare, KnowsPlainFieldsMotorsAndHealth) {
  const TickRecord logged{};
  TickRecord replayed{};
  replayed.duty[2] = -0.0;
  EXPECT_EQ(compared(logged, replayed).field, "EQUIPOISE_MOTORS.duty[2]") << "another zero is another number";
  replayed = {};
  replayed.degraded = 1;
  EXPECT_EQ(compared(logged, replayed).field, "EQUIPOISE_HEALTH.degraded");
  replayed = {};
  replayed.raw.gyro_counts[0] = 1.0;
  replayed.velocity_W_m_s[0] = 1.0;
  EXPECT_FALSE(compared(logged, replayed).found) << "what went into the tick was not computed";
}

TEST(Compare, AnyNaNIsAnyOtherAndNoNumber) {
  TickRecord logged{};
  TickRecord replayed{};
  logged.duty[0] = std::numeric_limits<double>::quiet_NaN();
  replayed.duty[0] = -std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(compared(logged, replayed).found);
  replayed.duty[0] = 0.0;
  EXPECT_TRUE(compared(logged, replayed).found);
  EXPECT_TRUE(compared(replayed, logged).found);
}

TEST(Compare, KeepsTheFirstTicksDifference) {
  Difference d;
  TickRecord replayed{};
  replayed.duty[0] = 1.0;
  TickRecord logged{};
  logged.tick = 1;
  app::compare(logged, replayed, &d);
  logged.tick = 2;
  app::compare(logged, replayed, &d);
  EXPECT_EQ(d.tick, 1);
}

TEST(Judged, ByTheTruthAndItsClockWhereThereIsOne) {
  TickRecord r{};
  r.tick = 300;
  r.now_ns = 9'000'000'000;
  r.arm = true;
  r.reasons = 5;
  r.arm_state = static_cast<std::int32_t>(ArmState::kArmed);
  app::VerdictJudge::Tick t = app::judged(r);
  EXPECT_DOUBLE_EQ(t.t_s, 1.5) << "200 Hz";
  EXPECT_TRUE(std::isnan(t.true_tilt_rad));
  r.has_truth = true;
  r.truth.theta_rad[0] = 0.3;
  r.truth.theta_rad[1] = -0.4;
  t = app::judged(r);
  EXPECT_DOUBLE_EQ(t.t_s, 9.0);
  EXPECT_DOUBLE_EQ(t.true_tilt_rad, 0.5);
}

TEST(Settled, IsFromTheFifthSecondOn) {
  TickRecord r{};
  r.now_ns = 60'000'000'000;  // a robot's clock starts anywhere
  r.tick = 999;
  EXPECT_FALSE(app::settled(r));
  r.tick = 1000;
  EXPECT_TRUE(app::settled(r));
  r.has_truth = true;
  r.now_ns = 4'999'999'999;
  EXPECT_FALSE(app::settled(r));
  r.now_ns = 5'000'000'000;
  EXPECT_TRUE(app::settled(r));
}

class ReplayRun : public testing::Test {
 protected:
  using Firmware = app::MbbrFirmware;
  static constexpr int kTicks = 1200;

  ReplayRun() : path_(testing::TempDir() + "replay-run-" + std::to_string(::getpid()) + ".lcm") {}
  ~ReplayRun() override { std::filesystem::remove(path_); }

  /// A nominal run that drives; `edit` may spoil a tick on its way to the log, or keep it (false).
  template <class Edit>
  void record(Edit&& edit) const {
    app::FaultPlan plan;
    plan.phase = app::Phase::kDriving;
    plan.fault_at_tick = 1 << 20;
    plan.end_tick = kTicks;
    record_run<Firmware>(path_, plan, 1, [&](auto& telemetry, const TickRecord& r, const auto&, const auto&) {
      TickRecord logged = r;
      logged.has_truth = true;  // wrong by a known tilt
      logged.truth = r.estimate;
      logged.truth.theta_rad[0] += 0.02;
      if (edit(logged)) telemetry.hand_over(logged);
    });
  }
  app::Replay replayed(const app::Beside& beside = {}) const {
    app::RunLog log(path_);
    return app::replay_as<Firmware>(log, path_, beside);
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

TEST_F(ReplayRun, ALostTickIsMissingAndAChangedNumberADifference) {
  record([](TickRecord& r) { return r.tick != 50 && r.tick != 51; });
  app::Replay r = replayed();
  EXPECT_EQ(r.missing, 2);
  EXPECT_EQ(r.ticks, kTicks - 2);
  EXPECT_FALSE(r.identical());
  record([](TickRecord& t) {
    if (t.tick == 60) t.duty[1] += 1e-12;
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
