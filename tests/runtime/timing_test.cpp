#include "equipoise/runtime/timing.hpp"

#include <gtest/gtest.h>

#include "equipoise/runtime/realtime.hpp"

namespace equipoise::runtime {
namespace {

constexpr std::int64_t kTick_ns = 5'000'000;

TEST(LoopTimingTest, CountsSkippedTicksAndForbidsMotorsAfterALongGap) {
  LoopTiming timing;
  std::int64_t now = kTick_ns;
  const auto tick = [&](int ticks_later) {
    now += ticks_later * kTick_ns;
    timing.begin(now + 20'000, now);
    timing.end(now + 320'000);
  };
  for (int i = 0; i < 100; ++i) tick(1);
  EXPECT_EQ(timing.now().overruns, 0);
  EXPECT_EQ(timing.now().wake_late_ns, 20'000);
  EXPECT_EQ(timing.now().compute_ns, 300'000);
  tick(3);  // two missed: rode through
  EXPECT_EQ(timing.now().overruns, 2);
  EXPECT_FALSE(timing.overrun());
  tick(1);
  tick(4);  // three missed
  EXPECT_TRUE(timing.overrun());
  tick(1);
  EXPECT_FALSE(timing.overrun());
}

TEST(LoopTimingTest, OverrunsInARowForbidMotors) {
  LoopTiming timing;
  std::int64_t now = kTick_ns;
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(timing.overrun());
    now += i == 0 ? kTick_ns : 2 * kTick_ns;
    timing.begin(now, now);
  }
  EXPECT_TRUE(timing.overrun());
}

TEST(LoopTimingTest, OverrunsApartFromEachOtherDoNot) {
  LoopTiming timing;
  std::int64_t now = kTick_ns;
  for (int i = 0; i < 40; ++i) {
    now += i % 4 == 3 ? 2 * kTick_ns : kTick_ns;
    timing.begin(now, now);
    EXPECT_FALSE(timing.overrun()) << i;
  }
  EXPECT_EQ(timing.now().overruns, 10);
}

TEST(TimeHistogramTest, QuantilesAreWithinABin) {
  TimeHistogram histogram;
  for (int i = 0; i < 990; ++i) histogram.add(20'000);
  for (int i = 0; i < 10; ++i) histogram.add(900'000'000'000);
  EXPECT_EQ(histogram.total(), 1000);
  EXPECT_GE(histogram.quantile_ns(0.5), 20'000);
  EXPECT_LE(histogram.quantile_ns(0.5), 25'000);  // four bins per octave
  EXPECT_GT(histogram.quantile_ns(0.995), 100'000'000);
  EXPECT_EQ(histogram.max_ns(), 900'000'000'000);
}

TEST(TimeHistogramTest, ABinEndsBelowItsUpperEdge) {
  for (std::size_t bin = 0; bin < TimeHistogram::kBins; ++bin) {
    TimeHistogram histogram;
    const bool last = bin + 1 == TimeHistogram::kBins;
    histogram.add(bin == 0 ? 0 : TimeHistogram::upper_ns(bin - 1));
    histogram.add(last ? INT64_MAX : TimeHistogram::upper_ns(bin) - 1);
    EXPECT_EQ(histogram.bins()[bin], 2) << bin;
  }
}

TEST(RealtimeTest, SaysItemByItemWhatIsMissing) {
  RealtimeWish wish;
  wish.priority = 0;
  wish.lock_memory = false;
  wish.cpu = 4096;  // none has so many
  wish.cpu_latency_device = "/proc";
  const Realtime realtime(wish);
  EXPECT_FALSE(realtime.complete());
  EXPECT_FALSE(realtime.results()[kScheduler].wanted);
  EXPECT_TRUE(realtime.results()[kStack].obtained);
  EXPECT_EQ(realtime.results()[kAffinity].error, EINVAL);
  EXPECT_EQ(realtime.results()[kCpuLatency].error, EISDIR);
  EXPECT_NE(realtime.complaint().find("cpu_latency not obtained: Is a directory"), std::string::npos);
}

TEST(RealtimeTest, AKernelWithoutIdleStatesLacksNothing) {
  RealtimeWish wish;
  wish.priority = 0;
  wish.lock_memory = false;
  wish.cpu_latency_device = "/nonexistent/cpu_dma_latency";
  EXPECT_TRUE(Realtime(wish).complete());
}

TEST(RealtimeTest, LeavesTheThreadAsItWas) {
  {
    RealtimeWish wish;
    wish.cpu = 0;
    const Realtime realtime(wish);
  }
  EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER);
}

}  // namespace
}  // namespace equipoise::runtime
