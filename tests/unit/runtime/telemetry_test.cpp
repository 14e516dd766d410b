// Records that find no room are counted, and the run's report says how many; what is published is for eyes.
#include "equipoise/runtime/telemetry.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

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

TEST_F(TelemetryTest, WhoWatchesSeesEveryRecordOnTheWritersThread) {
  std::vector<std::int64_t> seen;
  std::thread::id watcher;
  TelemetryOptions options;
  options.wait_when_full = true;
  options.watch = [&](const TickRecord& r) {
    seen.push_back(r.tick);
    watcher = std::this_thread::get_id();
  };
  Telemetry telemetry(options);
  TickRecord record{};
  for (record.tick = 0; record.tick < 3; ++record.tick) telemetry.hand_over(record);
  (void)telemetry.finish(EndRecord{});
  EXPECT_EQ(seen, (std::vector<std::int64_t>{0, 1, 2}));
  EXPECT_NE(watcher, std::this_thread::get_id()) << "the tick waits for nobody's terminal";
}

/// A message costs its packet and the kernel's way: with 8 a record, more than everything else that is
/// logged.
TEST_F(TelemetryTest, PublishesNoMoreOftenThanItIsAskedTo) {
  TelemetryOptions options;
  options.url = "file://" + path_ + "?mode=w";
  const auto start = std::chrono::steady_clock::now();
  Telemetry telemetry(options);
  TickRecord record{};
  for (record.tick = 1; record.tick <= 100; ++record.tick) {
    telemetry.hand_over(record);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  (void)telemetry.finish(EndRecord{});
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  std::ifstream file(path_, std::ios::binary);
  const std::string published{std::istreambuf_iterator<char>(file), {}};
  int states = 0;
  for (std::size_t at = 0; (at = published.find("EQUIPOISE_STATE", at)) != std::string::npos; ++at) ++states;
  EXPECT_GE(states, 2);
  EXPECT_LE(states, 25.0 * took.count() + 1.0);
}

}  // namespace
}  // namespace equipoise::runtime
