#include "app/run/realtime_session.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace equipoise::app {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// As far as the second tick: what stands against arming, what is said, and the summary.
struct Session {
  Session(bool needs_realtime, bool needs_calibration, const std::string& missing_calibration) {
    SessionOptions options;
    options.guard = false;
    options.realtime = needs_realtime;
    options.calibrated = needs_calibration;
    options.priority = 0;
    options.cpu = 1 << 20;  // no machine has it: never complete, whatever this user may do
    testing::internal::CaptureStderr();
    RealtimeSession session(options, missing_calibration);
    std::atomic<bool> log_failed{false};
    runtime::Supervisor& supervisor = session.begin(log_failed);
    RawSample raw{};
    raw.t_ns = runtime::monotonic_now_ns() - 1'000'000'000;
    for (int tick = 0; tick < 2; ++tick, raw.t_ns += 5'000'000) {
      inhibit = supervisor.begin(raw.t_ns, raw);
      supervisor.end(false, 0);
    }
    session.end();
    said = testing::internal::GetCapturedStderr();
    summary = session.summary();
  }
  std::uint32_t inhibit = 0;
  std::string said;
  nlohmann::json summary;
};

TEST(RealtimeSession, WithoutWhatItNeedsTheMotorsStayOff) {
  const Session s(true, true, "accel");
  EXPECT_EQ(s.inhibit, kRealtimeMissing | kNotCalibrated);
  EXPECT_THAT(s.said, AllOf(HasSubstr("no guard"), HasSubstr("stay off without a calibration"),
                            HasSubstr(": accel ("), HasSubstr("stay off without real time"),
                            HasSubstr("affinity not obtained: Invalid argument")));
  EXPECT_EQ(s.summary["calibrated"], false);
}

TEST(RealtimeSession, WhoDoesWithoutIsWarned) {
  const Session s(false, false, "accel");
  EXPECT_EQ(s.inhibit, 0U);
  EXPECT_THAT(s.said, AllOf(HasSubstr("running without a calibration"),
                            HasSubstr("running without full real time"), Not(HasSubstr("stay off"))));
}

TEST(RealtimeSession, ItsSummaryHasWhatWasObtainedAndTheTimesOfTheTicks) {
  const Session s(false, true, "");
  EXPECT_EQ(s.inhibit, 0U);
  EXPECT_THAT(s.said, Not(HasSubstr("calibration")));
  const nlohmann::json& all = s.summary;
  EXPECT_EQ(all["guard"], false);
  EXPECT_EQ(all["calibrated"], true);
  EXPECT_EQ(all["overruns"], 0);
  EXPECT_EQ(all["wake_late"]["count"], 1) << "the first wake-up is nobody's due";
  EXPECT_EQ(all["compute"]["count"], 2);
  for (const char* times : {"wake_late", "compute"}) {
    for (const char* key : {"p50_us", "p99_us", "max_us"})
      EXPECT_TRUE(all[times][key].is_number()) << times << key;
  }
  EXPECT_EQ(all["realtime"]["complete"], false);
  EXPECT_EQ(all["realtime"]["affinity"],
            (nlohmann::json{{"wanted", true}, {"obtained", false}, {"errno", EINVAL}}));
  EXPECT_EQ(all["realtime"]["scheduler"],
            (nlohmann::json{{"wanted", false}, {"obtained", false}, {"errno", 0}}));
}

TEST(RealtimeSession, TimesAreInMicroseconds) {
  runtime::TimeHistogram times;
  for (int i = 0; i < 98; ++i) times.add(1000);
  times.add(2'000'000);
  times.add(9'000'000);
  const nlohmann::json told = to_json(times);
  EXPECT_NEAR(told["p50_us"], 1.0, 0.1);
  EXPECT_NEAR(told["p99_us"], 9000.0, 900.0);
  EXPECT_EQ(told["max_us"], 9000.0);
  EXPECT_EQ(told["count"], 100);
}

}  // namespace
}  // namespace equipoise::app
