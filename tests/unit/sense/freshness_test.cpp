// What of a sample may be used, and what stands in for the rest.
#include "equipoise/sense/freshness.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <limits>

#include "support/assign.hpp"

namespace equipoise {
namespace {

constexpr std::int64_t kTick = 5'000'000;

/// A sound robot whose wheels turn by two counts a tick; the model knows it.
class Robot {
 public:
  Robot() : freshness_({3, 10.0}) {}

  RawSample sound() const {
    RawSample raw{};
    raw.t_ns = now_ns;
    raw.valid = RIO_IMU | RIO_ENCODERS | RIO_BATTERY | RIO_ATTITUDE;
    const auto n = static_cast<double>(tick);
    assign(raw.gyro_counts, {3.0 + n, -4.0 + n, 5.0 - n});
    assign(raw.accel_counts, {n, 2.0 * n, 4096.0});
    assign(raw.encoder_counts, {2.0 * n, 2.0 * n, 2.0 * n, 0.0});
    raw.battery_counts = 1700.0;
    assign(raw.attitude_wxyz, {1.0, 0.0, 0.0, 0.0});
    return raw;
  }
  void pass(int ticks = 1) {
    tick += ticks;
    now_ns += ticks * kTick;
  }
  Fresh see(const RawSample& raw) { return freshness_.update(raw, now_ns, {2.0, 2.0, 2.0, 0.0}); }
  Fresh next(int ticks = 1) {
    pass(ticks);
    return see(sound());
  }

  int tick = 0;
  std::int64_t now_ns = 1'000'000'000;

 private:
  Freshness freshness_;
};

TEST(FreshnessTest, CountsTicksByTheLoopsClockNotByTheStamp) {
  Robot robot;
  robot.next();
  EXPECT_EQ(robot.next().ticks, 1);
  robot.now_ns += 2'000'000;  // woken late, but within the tick
  EXPECT_EQ(robot.next().ticks, 1);
  EXPECT_EQ(robot.next(7).ticks, 7);
  robot.pass(3);
  RawSample old = robot.sound();
  old.t_ns -= 3 * kTick;
  EXPECT_EQ(robot.see(old).ticks, 3);
}

TEST(FreshnessTest, TheLastSampleOnceMoreIsNoneOfTheEncodersEither) {
  Robot robot;
  const RawSample last = robot.next().raw;
  const RawSample again = robot.sound();
  for (int i = 1; i <= 5; ++i) {
    robot.pass();
    const Fresh fresh = robot.see(again);
    EXPECT_EQ(fresh.raw.valid & (RIO_IMU | RIO_ENCODERS), 0U);
    EXPECT_EQ(fresh.raw.encoder_counts[0], last.encoder_counts[0] + 2.0 * i);  // carried on by the model
  }
  EXPECT_EQ(robot.next().raw.valid, last.valid);
}

TEST(FreshnessTest, EncodersThatStandStillUnderALiveImuAreBelieved) {
  Robot robot;
  robot.next();
  RawSample still = robot.sound();
  for (int i = 0; i < 5; ++i) {
    robot.pass();
    RawSample raw = robot.sound();
    std::copy(std::begin(still.encoder_counts), std::end(still.encoder_counts), raw.encoder_counts);
    EXPECT_NE(robot.see(raw).raw.valid & RIO_ENCODERS, 0U);
  }
}

TEST(FreshnessTest, ReplacesWhatIsNotANumberByTheLastThatWas) {
  Robot robot;
  const RawSample last = robot.next().raw;
  robot.pass();
  RawSample bad = robot.sound();
  bad.gyro_counts[1] = std::numeric_limits<double>::quiet_NaN();
  bad.encoder_counts[2] = std::numeric_limits<double>::infinity();
  bad.battery_counts = std::numeric_limits<double>::quiet_NaN();
  const Fresh fresh = robot.see(bad);
  EXPECT_EQ(fresh.raw.valid, static_cast<unsigned>(RIO_ATTITUDE));
  EXPECT_EQ(fresh.raw.gyro_counts[1], last.gyro_counts[1]);
  EXPECT_EQ(fresh.raw.encoder_counts[2], last.encoder_counts[2] + 2.0);  // carried on by the model
  EXPECT_EQ(fresh.raw.battery_counts, last.battery_counts);
  EXPECT_EQ(robot.next().raw.valid, last.valid);
}

TEST(FreshnessTest, ACountJumpBecomesTheStepThatTheModelExpects) {
  Robot robot;
  robot.next();
  const double before = robot.next().raw.encoder_counts[1];
  for (int i = 1; i <= 5; ++i) {
    robot.pass();
    RawSample jumped = robot.sound();
    jumped.encoder_counts[1] += 500.0;
    const Fresh fresh = robot.see(jumped);
    EXPECT_FALSE(fresh.encoder_jump);
    EXPECT_EQ(fresh.raw.encoder_counts[1], before + 2.0 * i);
  }
}

TEST(FreshnessTest, AnEncoderThatJumpsAgainAndAgainIsNotBelieved) {
  Robot robot;
  robot.next();
  bool found = false;
  for (int i = 1; i <= 20; ++i) {
    robot.pass();
    RawSample jumping = robot.sound();
    jumping.encoder_counts[0] += 500.0 * (i % 2);
    found = found || robot.see(jumping).encoder_jump;
  }
  EXPECT_TRUE(found);
}

TEST(FreshnessTest, AStampThatStepsIsANewClockButALateOneAnOldSample) {
  Robot robot;
  robot.next();
  const auto stamped = [&robot](std::int64_t by_ns) {
    robot.pass();
    RawSample raw = robot.sound();
    raw.t_ns += by_ns;
    return imu_ok(robot.see(raw).raw);
  };
  EXPECT_TRUE(stamped(0));
  EXPECT_TRUE(stamped(1'000'000'000));
  EXPECT_TRUE(stamped(1'000'000'000));
  for (int i = 0; i < 400; ++i)
    ASSERT_FALSE(stamped(1'000'000'000 - 15'000'000));  // three ticks old, for good
  EXPECT_TRUE(stamped(1'000'000'000));
}

TEST(FreshnessTest, OneSampleTwiceIsNotNews) {
  Robot robot;
  const RawSample first = robot.next().raw;
  robot.pass();
  EXPECT_FALSE(imu_ok(robot.see(first).raw));
}

TEST(FreshnessTest, OtherCountsUnderTheSameStampAreNotNews) {
  Robot robot;
  const std::int64_t stamp = robot.next().raw.t_ns;
  robot.pass();
  RawSample raw = robot.sound();
  raw.t_ns = stamp;
  EXPECT_FALSE(imu_ok(robot.see(raw).raw));
  EXPECT_TRUE(imu_ok(robot.next().raw));
}

TEST(FreshnessTest, AnAxisWhoseCountStandsStillForSixTicksIsDead) {
  Robot robot;
  const double stuck = robot.next().raw.gyro_counts[2];
  for (int i = 1; i <= 8; ++i) {
    robot.pass();
    RawSample raw = robot.sound();
    raw.gyro_counts[2] = stuck;
    const Fresh fresh = robot.see(raw);
    EXPECT_TRUE(fresh.gyro_axis_ok[0] && fresh.gyro_axis_ok[1]);
    EXPECT_EQ(fresh.gyro_axis_ok[2], i < 6) << i;
  }
  EXPECT_TRUE(robot.next().gyro_axis_ok[2]);
}

}  // namespace
}  // namespace equipoise
