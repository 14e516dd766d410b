#include "app/trial/verdict.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "app/text/json.hpp"
#include "equipoise/actuate/safety_reasons.hpp"

namespace equipoise::app {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

VerdictJudge balancing(double tilt_rad = 0.01) {
  VerdictJudge judge;
  judge.observe({0.0, false, false, kNotRequested, tilt_rad});
  judge.observe({0.5, true, true, 0, tilt_rad});
  judge.observe({3.0, true, true, 0, tilt_rad});
  return judge;
}

TEST(Verdict, ARunThatBalancesToTheEndIsFinished) {
  const Verdict v = balancing().verdict(false, false);
  EXPECT_STREQ(v.name(), "finished");
  EXPECT_FALSE(v.fell());
  EXPECT_EQ(v.sentence(), "Finished after 3.0 s, upright");
}

TEST(Verdict, MotorsOffWhileAskedForIsDisarmedAndKeepsItsReason) {
  VerdictJudge judge = balancing();
  judge.observe({3.2, true, false, kImuStale, 0.02});
  EXPECT_TRUE(judge.lost());
  judge.observe({4.0, true, false, kImuStale | kTilt, 1.5});  // it lies, later
  const Verdict v = judge.verdict(true, true);
  EXPECT_STREQ(v.name(), "disarmed");
  EXPECT_TRUE(v.fell());
  EXPECT_EQ(v.fell_at_s, 3.2);
  EXPECT_EQ(v.reasons, kImuStale);
  EXPECT_EQ(v.sentence(), "The motors were off while asked for at 3.20 s: imu_stale");
}

TEST(Verdict, TheTruthDecidesWhetherARobotFell) {
  VerdictJudge over = balancing();
  over.observe({3.2, true, true, 0, 0.61});
  EXPECT_EQ(over.verdict(false, false).ended, Ended::kFell);

  VerdictJudge wrong_estimate = balancing();
  wrong_estimate.observe({3.2, true, false, kTilt, 0.1});
  EXPECT_EQ(wrong_estimate.verdict(false, false).ended, Ended::kDisarmed);

  VerdictJudge on_the_robot = balancing(kUnknown);
  on_the_robot.observe({3.2, true, false, kTilt, kUnknown});
  EXPECT_EQ(on_the_robot.verdict(false, false).ended, Ended::kFell);
}

TEST(Verdict, ARequestThatIsWithdrawnIsNoFall) {
  VerdictJudge judge = balancing();
  judge.observe({3.2, false, false, kNotRequested, 0.02});
  EXPECT_FALSE(judge.lost());
  EXPECT_EQ(judge.verdict(true, false).ended, Ended::kInterrupted);
}

TEST(Verdict, ARobotThatNeverArmedIsDisarmed) {
  VerdictJudge judge;
  judge.observe({0.5, true, false, kBatteryLow, kUnknown});
  EXPECT_FALSE(judge.refused());  // give it a moment
  judge.observe({0.7, true, false, kBatteryLow, kUnknown});
  EXPECT_TRUE(judge.refused());
  EXPECT_FALSE(judge.lost());  // it may still arm
  EXPECT_EQ(judge.verdict(false, false).ended, Ended::kDisarmed);
  judge.observe({0.8, true, true, 0, kUnknown});
  EXPECT_EQ(judge.verdict(false, false).ended, Ended::kFinished);
}

TEST(Verdict, AFailedDeviceSaysSo) {
  nlohmann::json out;
  balancing().verdict(false, true).write(&out);
  EXPECT_EQ(out["ended"], "device");
  EXPECT_EQ(out["fell"], false);
  EXPECT_TRUE(out["fell_at_s"].is_null());
  EXPECT_EQ(out["reasons"], nlohmann::json::array());
}

}  // namespace
}  // namespace equipoise::app
