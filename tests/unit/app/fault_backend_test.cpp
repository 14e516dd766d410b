// What each fault does to samples and motors: one row a fault, against a robot that counts.
#include "app/io/fault_backend.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace equipoise::app {
namespace {

constexpr int kBefore = 10;  // ticks that are sound
constexpr std::uint32_t kAll = RIO_IMU | RIO_ENCODERS | RIO_BATTERY | RIO_ATTITUDE;

/// Of tick n, no two numbers alike.
rio_sensors_t sound(int n) {
  rio_sensors_t s{};
  s.t_ns = n * 5'000'000LL;
  for (int i = 0; i < 3; ++i) {
    s.gyro_counts[i] = 100.0 * (i + 1) + n;
    s.accel_counts[i] = 1000.0 * (i + 1) + n;
  }
  for (int i = 0; i < RIO_MAX_MOTORS; ++i) s.encoder_counts[i] = 10000.0 * (i + 1) + 10.0 * n;
  s.battery_counts = 800.0;
  s.valid = kAll;
  return s;
}

class Robot final : public Backend {
 public:
  int ticks = 0;
  int offs = 0;
  int closed = 0;
  int status = 0;
  rio_motors_t told{};

 private:
  int wait_tick(std::int64_t* now_ns) override {
    ++ticks;
    *now_ns = ticks * 5'000'000LL;
    return status;
  }
  int read_sensors(rio_sensors_t* out) override {
    *out = sound(ticks);
    return status;
  }
  int write_motors(const rio_motors_t& motors) override {
    told = motors;
    return status;
  }
  int motors_off() override { return ++offs, status; }
  void close() override { ++closed; }
};

struct Broken {
  explicit Broken(FaultKind kind, int ticks = 1000) {
    for (int n = 1; n <= kBefore; ++n) EXPECT_EQ(next().t_ns, sound(n).t_ns);
    faulty.start(kind, ticks);
  }
  rio_sensors_t next() {
    EXPECT_EQ(rio_wait_tick(&io, &now_ns), 0);
    rio_sensors_t s{};
    EXPECT_EQ(rio_read_sensors(&io, &s), 0);
    return s;
  }
  int write(std::vector<double> duty) {
    rio_motors_t m{};
    std::copy(duty.begin(), duty.end(), m.duty);
    return rio_write_motors(&io, &m);
  }

  Robot robot;
  FaultBackend faulty{robot.io(), 7};
  rio_t io = faulty.io();
  std::int64_t now_ns = 0;
};

void expect_same(const rio_sensors_t& a, const rio_sensors_t& b, const std::string& where) {
  const auto flat = [](const rio_sensors_t& s) {
    std::vector<double> v{static_cast<double>(s.t_ns), s.battery_counts, double(s.valid), double(s.health)};
    v.insert(v.end(), std::begin(s.gyro_counts), std::end(s.gyro_counts));
    v.insert(v.end(), std::begin(s.accel_counts), std::end(s.accel_counts));
    v.insert(v.end(), std::begin(s.encoder_counts), std::end(s.encoder_counts));
    return v;
  };
  EXPECT_EQ(flat(a), flat(b)) << where;
}

/// `spoils`: what the fault makes of the sound sample of tick n, its `age`-th, the first being 1.
struct Corruption {
  FaultKind kind;
  std::function<void(rio_sensors_t& s, int n, int age)> spoils;
};

void invalid(rio_sensors_t& s, std::uint32_t bits, std::uint32_t health = 0) {
  s.valid &= ~bits;
  s.health |= health;
}
void no_imu(rio_sensors_t& s) {
  invalid(s, RIO_IMU);
  for (int i = 0; i < 3; ++i) s.gyro_counts[i] = s.accel_counts[i] = 0.0;
}
void imu_of(rio_sensors_t& s, int n) {
  for (int i = 0; i < 3; ++i) {
    s.gyro_counts[i] = sound(n).gyro_counts[i];
    s.accel_counts[i] = sound(n).accel_counts[i];
  }
}

using S = rio_sensors_t;
const Corruption kCorruptions[] = {
    {FaultKind::kImuOff, [](S& s, int, int) { no_imu(s); }},
    {FaultKind::kImuGap, [](S& s, int, int) { no_imu(s); }},
    {FaultKind::kAllGap, [](S& s, int, int) { no_imu(s), s.valid = 0; }},
    {FaultKind::kImuStuck, [](S& s, int, int) { imu_of(s, kBefore); }},
    {FaultKind::kBiasJump,
     [](S& s, int, int) {
       for (double& g : s.gyro_counts) g += 0.2 * 16.4 * 180.0 / std::acos(-1.0);
     }},
    {FaultKind::kGyroRamp,
     [](S& s, int, int age) {
       for (double& g : s.gyro_counts) g += 0.2 * 16.4 * 180.0 / std::acos(-1.0) * 0.005 * age;
     }},
    {FaultKind::kAccelFrozen,
     [](S& s, int, int) { std::copy_n(sound(kBefore).accel_counts, 3, s.accel_counts); }},
    {FaultKind::kDelayed, [](S& s, int n, int) { s = sound(n - 3); }},
    {FaultKind::kDuplicated, [](S& s, int, int) { s = sound(kBefore); }},
    {FaultKind::kHalfRate,
     [](S& s, int n, int age) {
       if (age % 2 != 0) imu_of(s, n - 1), s.t_ns = sound(n - 1).t_ns;
     }},
    {FaultKind::kTornPacket, [](S& s, int, int) { invalid(s, RIO_ATTITUDE, RIO_DMP_BAD_PACKET); }},
    {FaultKind::kFifoOverflow, [](S& s, int, int) { invalid(s, RIO_ATTITUDE, RIO_DMP_OVERFLOW); }},
    {FaultKind::kNack, [](S& s, int, int) { invalid(s, RIO_IMU | RIO_ATTITUDE, RIO_IMU_BUS_ERROR); }},
    {FaultKind::kLostInterrupt,
     [](S& s, int, int) {
       invalid(s, RIO_IMU | RIO_ATTITUDE, RIO_IMU_LATE);
       s.t_ns = sound(kBefore).t_ns;
     }},
    {FaultKind::kGyroYFrozen, [](S& s, int, int) { s.gyro_counts[1] = sound(kBefore).gyro_counts[1]; }},
    {FaultKind::kGyroXZero, [](S& s, int, int) { s.gyro_counts[0] = 0.0; }},
    {FaultKind::kGyroZZero, [](S& s, int, int) { s.gyro_counts[2] = 0.0; }},
    {FaultKind::kGyroYFlipped, [](S& s, int, int) { s.gyro_counts[1] *= -1.0; }},
    {FaultKind::kGyroXYSwapped, [](S& s, int, int) { std::swap(s.gyro_counts[0], s.gyro_counts[1]); }},
    {FaultKind::kGyroZXSwapped, [](S& s, int, int) { std::swap(s.gyro_counts[2], s.gyro_counts[0]); }},
    {FaultKind::kEncoderReversal, [](S& s, int, int age) { s.encoder_counts[0] -= 20.0 * age; }},
    {FaultKind::kCountJump, [](S& s, int, int) { s.encoder_counts[1] += 500.0; }},
    {FaultKind::kWheelLoss, [](S& s, int, int age) { s.encoder_counts[0] -= 10.0 * age; }},
    {FaultKind::kEncoderDead, [](S& s, int, int) { s.encoder_counts[0] = 0.0; }},
    {FaultKind::kTwoEncodersDead,
     [](S& s, int, int age) {
       s.encoder_counts[0] -= 10.0 * age;
       s.encoder_counts[1] -= 10.0 * age;
     }},
    {FaultKind::kBatterySag, [](S& s, int, int) { s.battery_counts = 500.0; }},
    {FaultKind::kAdcOpen, [](S& s, int, int) { s.battery_counts = 0.0; }},
    {FaultKind::kClockJump, [](S& s, int, int) { s.t_ns += 1'000'000'000; }},
    {FaultKind::kMotorDead, [](S&, int, int) {}},
};

TEST(FaultBackend, SpoilsOfASampleWhatItsRowSaysAndNothingElse) {
  for (const Corruption& row : kCorruptions) {
    Broken b(row.kind, 30);
    const std::string name = kFaults[static_cast<std::size_t>(row.kind)].name;
    for (int age = 1; age <= 30; ++age) {
      rio_sensors_t expected = sound(b.robot.ticks + 1);
      row.spoils(expected, b.robot.ticks + 1, age);
      EXPECT_TRUE(b.faulty.active());
      expect_same(b.next(), expected, name + ", tick " + std::to_string(age));
    }
    rio_sensors_t after = b.next();
    EXPECT_FALSE(b.faulty.active()) << name;
    if (row.kind == FaultKind::kClockJump) after.t_ns -= 1'000'000'000;  // clocks do not jump back
    expect_same(after, sound(b.robot.ticks), name + ", over");
  }
}

TEST(FaultBackend, NotANumberIsThatOfOneAxis) {
  Broken b(FaultKind::kNotANumber);
  const rio_sensors_t s = b.next();
  EXPECT_TRUE(std::isnan(s.gyro_counts[1]));
  EXPECT_EQ(s.gyro_counts[0] + s.gyro_counts[2],
            sound(kBefore + 1).gyro_counts[0] + sound(kBefore + 1).gyro_counts[2]);
}

/// Chance has a seed: shares and sizes over a thousand ticks.
TEST(FaultBackend, WhatIsDrawnHasTheSizeAndTheShareThatItsRowSays) {
  const auto over = [](FaultKind kind, const std::function<double(const rio_sensors_t&, int n)>& of) {
    Broken b(kind, 2000);
    double sum = 0.0;
    for (int i = 0; i < 1000; ++i) {
      const rio_sensors_t s = b.next();
      sum += of(s, b.robot.ticks);
    }
    return sum / 1000.0;
  };
  EXPECT_NEAR(over(FaultKind::kBatteryFlicker, [](const S& s, int) { return s.battery_counts == 0.0; }), 0.3,
              0.04);
  EXPECT_NEAR(over(FaultKind::kEncoderErrors,
                   [](const S& s, int n) {
                     const bool failed = (s.valid & RIO_ENCODERS) == 0;
                     EXPECT_EQ(failed, (s.health & RIO_ENCODER_ERROR) != 0);
                     EXPECT_EQ(s.encoder_counts[3], failed ? 0.0 : sound(n).encoder_counts[3]);
                     EXPECT_EQ(s.valid | RIO_ENCODERS, kAll);
                     return failed;
                   }),
              0.3, 0.04);
  const auto bad = [](const S& s, int n) { return s.gyro_counts[2] != sound(n).gyro_counts[2]; };
  EXPECT_NEAR(over(FaultKind::kBadSamples, bad), 0.1, 1e-9);
  const auto size = [&](const S& s, int n) { return bad(s, n) ? std::abs(s.accel_counts[1]) : 0.0; };
  EXPECT_NEAR(over(FaultKind::kBadSamples, size), 0.1 * 0.5 * 32767.0, 300.0);
  const auto square = [](double x) { return x * x; };
  EXPECT_NEAR(
      std::sqrt(over(FaultKind::kNoiseBurst,
                     [&](const S& s, int n) { return square(s.gyro_counts[0] - sound(n).gyro_counts[0]); })),
      20.0 * 16.4, 20.0);
  EXPECT_NEAR(std::sqrt(over(
                  FaultKind::kNoiseBurst,
                  [&](const S& s, int n) { return square(s.accel_counts[2] - sound(n).accel_counts[2]); })),
              0.5 * 4096.0, 120.0);
}

TEST(FaultBackend, AStallTakesTicksAndTheGuardCutsUntilTheLoopLetsGo) {
  const struct {
    FaultKind kind;
    int ticks;
    bool cuts;
  } rows[] = {{FaultKind::kStall20ms, 5, true},
              {FaultKind::kStall50ms, 11, true},
              {FaultKind::kBusHang, 13, true},
              {FaultKind::kStall1ms, 1, false}};
  for (const auto& row : rows) {
    Broken b(row.kind);
    const rio_sensors_t s = b.next();
    EXPECT_EQ(b.robot.ticks - kBefore, row.ticks);
    EXPECT_EQ(b.now_ns, b.robot.ticks * 5'000'000LL + (row.cuts ? 0 : 1'000'000));
    EXPECT_EQ(s.health == RIO_IMU_BUS_ERROR, row.kind == FaultKind::kBusHang);
    EXPECT_EQ(b.robot.offs, row.cuts ? 1 : 0);
    EXPECT_EQ(b.write({0.5, 0.25}), 0);
    EXPECT_EQ(b.robot.told.duty[0], row.cuts ? 0.0 : 0.5) << "the guard holds them";
    EXPECT_EQ(rio_motors_off(&b.io), 0);
    EXPECT_EQ(b.robot.offs, row.cuts ? 2 : 1);
    EXPECT_EQ(b.write({0.5, 0.25}), 0);
    EXPECT_EQ(b.robot.told.duty[1], 0.25);
    b.next();
    EXPECT_EQ(b.robot.ticks - kBefore, row.ticks + 1) << "once";
  }
}

TEST(FaultBackend, MotorsThatDoNotDoAsTold) {
  const struct {
    FaultKind kind;
    int status;
    std::vector<double> done;
  } rows[] = {{FaultKind::kMotorDead, 0, {0.0, 0.25, 0.125}},
              {FaultKind::kMotorsSwapped, 0, {0.25, 0.5, 0.125}},
              {FaultKind::kMotorStuck, 0, {0.6, 0.25, 0.125}},
              {FaultKind::kWriteError, -EIO, {0.0, 0.0, 0.0}},
              {FaultKind::kImuOff, 0, {0.5, 0.25, 0.125}}};
  for (const auto& row : rows) {
    Broken b(row.kind);
    b.next();
    EXPECT_EQ(b.write({0.5, 0.25, 0.125}), row.status);
    EXPECT_EQ(std::vector<double>(b.robot.told.duty, b.robot.told.duty + 3), row.done);
  }
}

TEST(FaultBackend, ItsErrorsAreThoseOfWhatItWrapsAndWhatLiesOutsideIsTold) {
  Broken b(FaultKind::kLogFull, 2);
  EXPECT_FALSE(b.faulty.log_failed());
  for (const bool failed : {true, true, false}) {
    b.next();
    EXPECT_EQ(b.faulty.log_failed(), failed);
  }
  b.faulty.start(FaultKind::kRemoteLost, 1);
  EXPECT_TRUE(b.faulty.remote_silent());
  EXPECT_EQ(b.faulty.kind(), FaultKind::kRemoteLost);
  b.faulty.start(FaultKind::kStall20ms, 9);
  EXPECT_FALSE(b.faulty.remote_silent());
  b.robot.status = -ESHUTDOWN;
  rio_sensors_t s{};
  EXPECT_EQ(rio_wait_tick(&b.io, &b.now_ns), -ESHUTDOWN);
  EXPECT_EQ(rio_read_sensors(&b.io, &s), -ESHUTDOWN);
  EXPECT_EQ(b.write({0.5}), -ESHUTDOWN);
  EXPECT_EQ(rio_motors_off(&b.io), -ESHUTDOWN);
  rio_close(&b.io);
  EXPECT_EQ(b.robot.closed, 1);
}

}  // namespace
}  // namespace equipoise::app
