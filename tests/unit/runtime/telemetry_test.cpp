// Records that find no room are counted, and the run's report says how many.
#include "equipoise/runtime/telemetry.hpp"

#include <gtest/gtest.h>

#include "support/log_folder.hpp"

namespace equipoise::runtime {
namespace {

class TelemetryTest : public LogFolder {};

TEST_F(TelemetryTest, WhatFindsNoRoomIsReported) {
  TelemetryOptions options;
  options.log_path = path_;
  options.wait_when_full = false;  // as on the board
  Telemetry telemetry(options);
  constexpr std::int64_t kTicks = 200'000;  // handed over faster than they are written
  TickRecord record{};
  for (std::int64_t tick = 1; tick <= kTicks; ++tick) {
    record.tick = tick;
    telemetry.hand_over(record);
  }
  const TelemetryReport report = telemetry.finish(EndRecord{});
  EXPECT_GT(report.dropped, 0);
  EXPECT_EQ(report.records + report.dropped, kTicks);
}

}  // namespace
}  // namespace equipoise::runtime
