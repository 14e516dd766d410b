// The assembled board on the emulated robot: the whole path from pins to pins, and motors off from the
// kernel's side.
#include <bbb.h>
#include <cutoff.h>
#include <errno.h>
#include <gtest/gtest.h>
#include <monotonic.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench.hpp"

namespace {
class BoardHardware : public ::testing::Test {
 protected:
  void TearDown() override { rio_close(&io_); }
  void open() {
    bbb_error_t error{};
    ASSERT_EQ(bbb_open(&config_, &io_, &error), 0) << error.text;
  }
  rio_sensors_t tickAndRead() {
    int64_t now_ns = 0;
    EXPECT_EQ(rio_wait_tick(&io_, &now_ns), 0);
    rio_sensors_t sample{};
    EXPECT_EQ(rio_read_sensors(&io_, &sample), 0);
    return sample;
  }
  int write(double a, double b, double c) {
    const rio_motors_t command{{a, b, c, 0.0}, true};
    return rio_write_motors(&io_, &command);
  }
  // From the kernel's side: no pulse, all bridges asleep.
  void expectMotorsOff() {
    for (const Bench::Channel& channel : bench_.pwm()) EXPECT_EQ(channel.duty_ns, 0u);
    EXPECT_FALSE(bench_.pin("44e07000", 20));
  }
  // A process that drives all motors at half duty until it dies.
  pid_t driveInChild() {
    const pid_t child = fork();
    if (child == 0) {
      bbb_error_t error{};
      rio_t io{};
      const rio_motors_t command{{0.5, 0.5, 0.5, 0.0}, true};
      if (bbb_open(&config_, &io, &error) != 0 || rio_write_motors(&io, &command) != 0) {
        fprintf(stderr, "child: %s\n", error.text);
        _exit(1);
      }
      for (;;) pause();
    }
    for (int i = 0; i < 3000 && bench_.pwm()[2].duty_ns == 0; ++i) usleep(10000);
    EXPECT_EQ(bench_.pwm()[2].duty_ns, 25000u);
    return child;
  }
  static void killAndReap(pid_t child, int signal) {
    kill(child, signal);
    waitpid(child, nullptr, 0);
  }

  Bench bench_;
  bbb_config_t config_ = Bench::mbbr();
  rio_t io_{};
};
}  // namespace

TEST_F(BoardHardware, SensesThroughAllBuses) {
  bench_.setAdc(6, 1700);
  open();
  Metronome metronome(bench_);
  bench_.setImu({10, -20, 4096}, {100, -200, 300});
  bench_.setCounts({7, -8, 9});
  tickAndRead();
  const rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.valid, uint32_t{RIO_IMU | RIO_ENCODERS | RIO_BATTERY});
  EXPECT_EQ(sample.health, 0u);
  EXPECT_EQ(sample.accel_counts[2], 4096.0);
  EXPECT_EQ(sample.gyro_counts[1], -200.0);
  EXPECT_EQ(sample.encoder_counts[0], 7.0);
  EXPECT_EQ(sample.encoder_counts[1], -8.0);
  EXPECT_EQ(sample.encoder_counts[2], 9.0);
  EXPECT_EQ(sample.battery_counts, 1700.0);
  EXPECT_GT(sample.t_ns, 0);
  EXPECT_LE(sample.t_ns, monotonic_ns());
}

TEST_F(BoardHardware, DrivesPinsAndStopsThem) {
  open();
  expectMotorsOff();
  ASSERT_EQ(write(0.5, -0.25, 1.0), 0);
  const auto pwm = bench_.pwm();
  EXPECT_EQ(pwm[0].duty_ns, 25000u);
  EXPECT_EQ(pwm[1].duty_ns, 12500u);
  EXPECT_EQ(pwm[2].duty_ns, 50000u);
  EXPECT_TRUE(bench_.pin("44e07000", 20));
  EXPECT_TRUE(bench_.pin("4804c000", 28) && !bench_.pin("44e07000", 31)) << "motor 1 forward";
  EXPECT_TRUE(!bench_.pin("4804c000", 16) && bench_.pin("481ac000", 17)) << "motor 2 reverse";
  ASSERT_EQ(rio_motors_off(&io_), 0);
  expectMotorsOff();
  EXPECT_FALSE(bench_.pin("4804c000", 28) || bench_.pin("481ac000", 17));
}

TEST_F(BoardHardware, ALostInterruptIsALateTickAndComesBack) {
  config_.imu.late_after_us = 20000;
  open();
  Metronome metronome(bench_);
  for (int i = 0; i < 5; ++i) tickAndRead();
  metronome.pause(true);
  rio_sensors_t sample{};
  for (int i = 0; i < 5; ++i) sample = tickAndRead();
  EXPECT_EQ(sample.valid & RIO_IMU, 0u);
  EXPECT_EQ(sample.health, uint32_t{RIO_IMU_LATE});
  EXPECT_NE(sample.valid & RIO_ENCODERS, 0u);
  metronome.pause(false);
  for (int i = 0; i < 20 && (sample.valid & RIO_IMU) == 0; ++i) sample = tickAndRead();
  EXPECT_EQ(sample.health, 0u);
}

TEST_F(BoardHardware, ADisconnectedBusClearsTheBitUntilItIsBack) {
  open();
  Metronome metronome(bench_);
  tickAndRead();
  bench_.fault("imu", EREMOTEIO, UINT32_MAX);
  const rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.valid & RIO_IMU, 0u);
  EXPECT_EQ(sample.health, uint32_t{RIO_IMU_BUS_ERROR});
  bench_.fault("imu", 0, 0);
  EXPECT_NE(tickAndRead().valid & RIO_IMU, 0u);
}

TEST_F(BoardHardware, AMotorThatRefusesStopsAll) {
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  bench_.fault("pwm", EIO, 1);
  EXPECT_EQ(write(0.6, 0.6, 0.6), -EIO);
  expectMotorsOff();
}

TEST_F(BoardHardware, AShortedBridgeIsReported) {
  open();
  Metronome metronome(bench_);
  bench_.drivePin("4804c000", 17, false);
  bench_.drivePin("481ae000", 17, true);
  bench_.drivePin("481ae000", 16, true);
  ASSERT_EQ(write(1.0, 1.0, 1.0), 0);
  tickAndRead();
  EXPECT_EQ(tickAndRead().health, uint32_t{RIO_BRIDGE_FAULT});
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.bridge_faults[0], 1u);
  EXPECT_EQ(status.bridge_faults[1], 0u);
  bench_.drivePin("4804c000", 17, true);
  EXPECT_EQ(tickAndRead().health, 0u);
}

TEST_F(BoardHardware, ASecondOwnerIsRefusedByName) {
  open();
  rio_t second{};
  bbb_error_t error{};
  EXPECT_EQ(bbb_open(&config_, &second, &error), -EBUSY);
  EXPECT_NE(std::string(error.text).find("44e07000 line 20"), std::string::npos) << error.text;
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0) << "and the first one is none the worse";
  EXPECT_EQ(bench_.pwm()[0].duty_ns, 25000u);
}

TEST_F(BoardHardware, TheKernelKeepsADeadProcessesDuty) {
  const pid_t child = driveInChild();
  killAndReap(child, SIGKILL);
  EXPECT_EQ(bench_.pwm()[0].duty_ns, 25000u) << "why there is a guard process";
  open();  // the next start stops what it finds
  expectMotorsOff();
}

TEST_F(BoardHardware, TheGuardStopsADeadProcess) {
  cutoff_t guard;
  bbb_error_t error{};
  ASSERT_EQ(cutoff_open(&guard, &config_, &error), 0) << error.text;
  config_.enable_held_elsewhere = true;
  const pid_t child = driveInChild();
  ASSERT_EQ(cutoff_enable(&guard), 0);
  EXPECT_TRUE(bench_.pin("44e07000", 20));
  killAndReap(child, SIGKILL);
  EXPECT_EQ(cutoff_off(&guard), 0);
  expectMotorsOff();
  cutoff_close(&guard);
}

TEST_F(BoardHardware, TheGuardStopsAStoppedProcess) {
  cutoff_t guard;
  bbb_error_t error{};
  ASSERT_EQ(cutoff_open(&guard, &config_, &error), 0) << error.text;
  config_.enable_held_elsewhere = true;
  const pid_t child = driveInChild();
  ASSERT_EQ(cutoff_enable(&guard), 0);
  kill(child, SIGSTOP);
  EXPECT_EQ(cutoff_off(&guard), 0);
  expectMotorsOff();
  killAndReap(child, SIGKILL);
  cutoff_close(&guard);
}
