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
  EXPECT_EQ(v.sentence(), "Disarmed unexpectedly at 3.20 s: imu_stale");
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
  EXPECT_EQ(judge.verdict(true, false).reasons, kNotRequested) << "at the end, of a run that was not lost";
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

TEST(Verdict, ARequestIsTimedFromItsOwnBeginning) {
  VerdictJudge judge;
  judge.observe({0.5, true, false, kBatteryLow, kUnknown});
  judge.observe({0.55, false, false, kNotRequested, kUnknown});
  judge.observe({2.0, true, false, kBatteryLow, kUnknown});
  EXPECT_FALSE(judge.refused()) << "asked for anew";
  judge.observe({2.09, true, false, kBatteryLow, kUnknown});
  EXPECT_FALSE(judge.refused());
  judge.observe({2.11, true, false, kBatteryLow, kUnknown});
  EXPECT_TRUE(judge.refused());
  EXPECT_EQ(judge.verdict(false, false).fell_at_s, 2.11);
}

TEST(Verdict, AMomentForARequestIsATenthOfASecond) {
  VerdictJudge judge;
  for (const double t_s : {0.0, 0.09, 0.1}) {
    judge.observe({t_s, true, false, kBatteryLow, kUnknown});
    EXPECT_FALSE(judge.refused()) << t_s;
  }
  judge.observe({0.11, true, false, kBatteryLow, kUnknown});
  EXPECT_TRUE(judge.refused());
}

TEST(Verdict, ATiltNearTheFallIsOneWhereSafetySaysSo) {
  const auto ended = [](double tilt_rad, std::uint32_t reasons) {
    VerdictJudge judge = balancing();
    judge.observe({3.2, true, false, reasons, tilt_rad});
    return judge.verdict(false, false).ended;
  };
  EXPECT_EQ(ended(0.55, kTilt), Ended::kFell);
  EXPECT_EQ(ended(0.53, kTilt), Ended::kDisarmed);
  EXPECT_EQ(ended(0.59, kImuStale), Ended::kDisarmed);
  EXPECT_EQ(ended(0.61, kImuStale), Ended::kFell);
  EXPECT_EQ(ended(VerdictJudge::kFallenTilt_rad, kImuStale), Ended::kDisarmed) << "further, it says";
  EXPECT_EQ(ended(0.9 * VerdictJudge::kFallenTilt_rad, kTilt), Ended::kFell);
  VerdictJudge upright = balancing();
  upright.observe({3.2, true, true, 0, VerdictJudge::kFallenTilt_rad});
  EXPECT_FALSE(upright.lost());
}

TEST(Verdict, EveryEndIsASentence) {
  Verdict v;
  v.duration_s = 4.25;
  v.reasons = kNotRequested;
  EXPECT_EQ(v.sentence(), "Finished after 4.2 s, motors off: not_requested");
  v.ended = Ended::kInterrupted;
  EXPECT_EQ(v.sentence(), "Interrupted after 4.2 s, motors off: not_requested");
  v.ended = Ended::kDevice;
  v.reasons = 0;
  EXPECT_EQ(v.sentence(), "The device failed after 4.2 s, upright");
  v.ended = Ended::kFell;
  v.fell_at_s = 3.5;
  EXPECT_EQ(v.sentence(), "Fell over at 3.50 s");
  v.reasons = kTilt;
  EXPECT_EQ(v.sentence(), "Fell over at 3.50 s: tilt");
}

TEST(Verdict, IsTheSameFromALog) {
  for (const Ended ended :
       {Ended::kFinished, Ended::kFell, Ended::kDisarmed, Ended::kInterrupted, Ended::kDevice}) {
    Verdict v;
    v.ended = ended;
    v.reasons = kTilt;
    v.fell_at_s = 3.5;
    v.duration_s = 4.0;
    EXPECT_EQ(std::isnan(v.record().fell_at_s), !v.fell());
    const Verdict read = Verdict::of(v.record());
    EXPECT_EQ(read.ended, ended);
    EXPECT_EQ(read.reasons, v.reasons);
    EXPECT_EQ(read.fell_at_s, v.fell() ? 3.5 : 0.0);
    EXPECT_EQ(read.duration_s, 4.0);
  }
  for (const std::int32_t unknown : {-1, 5, 1000})
    EXPECT_EQ(Verdict::of({unknown, 0, 1.0, 2.0}).ended, Ended::kFinished) << unknown;
}

TEST(Verdict, TheNumbersAreThoseOfTheTickThatLostTheRobot) {
  VerdictJudge judge;
  ReasonNumbers numbers;
  judge.observe({0.0, true, false, 0, kUnknown, numbers});
  EXPECT_FALSE(judge.verdict(false, false).numbers.was_armed);
  EXPECT_FALSE(judge.armed());
  judge.observe({0.1, true, true, 0, kUnknown, numbers});
  EXPECT_TRUE(judge.armed());
  judge.observe({0.2, true, false, kTilt, kUnknown, numbers});
  EXPECT_TRUE(judge.verdict(false, false).numbers.was_armed);
  judge.observe({0.3, false, false, kNotRequested, kUnknown, numbers});
  EXPECT_EQ(judge.verdict(false, false).reasons, kTilt);
  EXPECT_EQ(judge.verdict(false, false).duration_s, 0.3);
}

TEST(Verdict, AFailedDeviceSaysSo) {
  nlohmann::json out;
  balancing().verdict(false, true).write(&out);
  EXPECT_EQ(out["ended"], "device");
  EXPECT_EQ(out["fell"], false);
  EXPECT_TRUE(out["fell_at_s"].is_null());
  EXPECT_EQ(out["reasons"], nlohmann::json::array());
  EXPECT_TRUE(out["verdicts"].is_null()) << "nothing was weighed";
}

constexpr std::int32_t row(std::string_view name) {
  std::int32_t i = 0;
  while (kFaultNames[static_cast<std::size_t>(i)] != name) ++i;
  return i;
}
constexpr std::int32_t kFirst = row("encoder_1"), kSecond = row("encoder_2"), kBias = row("gyro_bias");

std::vector<std::string> sentences(const Verdict& verdict) {
  std::vector<std::string> out;
  for (const FaultVerdict& each : verdict.faults) out.push_back(each.sentence());
  return out;
}

TEST(Verdict, ASensorsIsListedWhenItIsTakenAndWhenItIsTakenBack) {
  VerdictJudge judge;
  const auto weighed = [&](double t_s, const FaultEvidence& e) {
    judge.observe({t_s, true, true, 0, kUnknown, {}, e});
  };
  weighed(1.0, {kSecond, 17.0, 18.6, kFirst, 3.0, false, 0});
  weighed(2.0, {kSecond, 21.44, 18.6, kFirst, 3.0, true, 1U << kSecond});
  weighed(3.0, {kBias, 4.0, 18.6, -1, 0.0, false, 1U << kSecond});
  weighed(4.0, {kSecond, 19.0, 18.6, -1, 0.0, true, 0});
  nlohmann::json out;
  judge.verdict(false, false).write(&out);
  ASSERT_EQ(out["verdicts"].size(), 2U);
  EXPECT_EQ(out["verdicts"][0], nlohmann::json({{"t_s", 2.0},
                                                {"hypothesis", "encoder_2"},
                                                {"taken", true},
                                                {"ratio", 21.44},
                                                {"bound", 18.6},
                                                {"runner_up", "encoder_1"},
                                                {"runner_up_ratio", 3.0}}));
  EXPECT_EQ(out["verdicts"][1]["taken"], false);
  EXPECT_TRUE(out["verdicts"][1]["runner_up"].is_null());
  const auto lines = sentences(judge.verdict(false, false));
  EXPECT_EQ(lines.at(0),
            "verdict: encoder_2, log-likelihood ratio 21.4, bound 18.6, runner-up encoder_1 3.0");
  EXPECT_EQ(lines.at(1),
            "verdict taken back: encoder_2, log-likelihood ratio 19.0, bound 18.6, runner-up no fault 0.0");
}

/// What is printed under the sentence: what was said of the sensors, and why a robot was lost.
TEST(Verdict, ItsReasonsArePrintedForALostRobotAndItsSensorsForEach) {
  const auto printed = [](const Verdict& verdict) {
    char* text = nullptr;
    std::size_t size = 0;
    std::FILE* const out = open_memstream(&text, &size);
    print_reasons(out, verdict, SafetyParams{});
    std::fclose(out);
    const std::string said(text, size);
    std::free(text);
    return said;
  };
  VerdictJudge judge = balancing();
  EXPECT_EQ(printed(judge.verdict(false, false)), "");
  judge.observe({3.1, true, true, 0, 0.1, {}, {kSecond, 21.44, 18.6, kFirst, 3.0, true, 1U << kSecond}});
  const std::string sensor = printed(judge.verdict(false, false));
  EXPECT_EQ(sensor, "  3.100 s  " + sentences(judge.verdict(false, false)).at(0) + "\n");
  judge.observe({3.2, true, false, kImuStale, 0.1});
  const Verdict lost = judge.verdict(false, false);
  const std::string all = printed(lost);
  ASSERT_EQ(all.substr(0, sensor.size()), sensor);
  std::string reasons;
  for (const std::string& line : reasons_explained(lost.reasons, lost.numbers, SafetyParams{}))
    reasons.append("  ").append(line).append("\n");
  EXPECT_EQ(all.substr(sensor.size()), reasons);
  EXPECT_NE(reasons, "");
}

TEST(Verdict, TwoOfOneTickLeaveTheSensorOpenAndTheTickThatLosesTheRobotCounts) {
  VerdictJudge judge = balancing();
  judge.observe({3.2, true, false, kImuUntrusted, 0.1, {}, {kFirst, 30.0, 18.6, kSecond, 28.0, true, 3U}});
  judge.observe({3.3, true, false, kImuUntrusted, 0.1, {}, {-1, 0.0, 18.6, -1, 0.0, false, 3U}});
  const Verdict v = judge.verdict(false, false);
  EXPECT_TRUE(v.fell());
  ASSERT_EQ(sentences(v).size(), 1U);
  EXPECT_EQ(sentences(v)[0].substr(0, 33), "verdict: encoder_1 or encoder_2, ");
}

TEST(Verdict, OfMoreThanAListHoldsTheFirstAreKept) {
  VerdictJudge judge;
  for (int i = 0; i < 1000; ++i)
    judge.observe(
        {0.1 * i, true, true, 0, kUnknown, {}, {kBias, 20.0 + i, 18.6, -1, 0.0, true, 1U << kBias}});
  const auto lines = sentences(judge.verdict(false, false));
  EXPECT_GE(lines.size(), 16U);
  EXPECT_LT(lines.size(), 1000U);
  EXPECT_NE(lines.back().find("ratio " + std::to_string(lines.size() + 19)), std::string::npos);
}

}  // namespace
}  // namespace equipoise::app
