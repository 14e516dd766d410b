// The assembled board with other wirings than the Mini-MBB's: cape bridges, one motor, a rising edge.
#include <errno.h>

#include "bbb.h"
#include "board_fixture.hpp"
#include "gpio.h"
#include "monotonic.h"
#include "support/pin.hpp"

namespace {
class BbbWiringTest : public BoardFixture {
 protected:
  void useCapeBridges() {
    for (bbb_motor_t& motor : config_.motor) {
      motor.bridge = BBB_TB6612;
      motor.fault.used = false;
    }
  }
  std::string complaint(int expected) {
    bbb_error_t error{};
    EXPECT_EQ(bbb_open(&config_, &io_, &error), expected);
    EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
    EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
    EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0) << "of what was never open";
    return error.text;
  }
};
}  // namespace

TEST_F(BbbWiringTest, CapeBridgesDriveCoastAndClose) {
  useCapeBridges();
  open();
  ASSERT_EQ(write(0.5, -0.25, 0.1), 0);
  EXPECT_EQ(duties(), (std::vector<std::string>{"25000", "12500", "5000"}));
  EXPECT_EQ(tickAndRead().health, 0u) << "they have no status flag";
  ASSERT_EQ(rio_motors_off(&io_), 0);
  expectMotorsOff();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  rio_close(&io_);
  io_ = {};
  expectMotorsOff();
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}

TEST_F(BbbWiringTest, CapeBridgesTakeFasterPwm) {
  useCapeBridges();
  config_.pwm_hz = 100000;
  open();
  EXPECT_EQ(attribute(pwm_[0], "pwm0/period"), "10000");
}

TEST_F(BbbWiringTest, AFaultBehindACapeBridgeIsSeen) {
  config_.motor[0].bridge = BBB_TB6612;
  FakeGpio::instance().line("481ae000", 16).active = true;  // of the third motor
  open();
  ASSERT_EQ(write(0.0, 0.0, 1.0), 0);
  EXPECT_EQ(tickAndRead().health, uint32_t{RIO_BRIDGE_FAULT});
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.bridge_faults[0], 0u);
  EXPECT_EQ(status.bridge_faults[2], 1u);
}

TEST_F(BbbWiringTest, AStatusFlagThatCannotBeReadIsAFault) {
  open();
  ASSERT_EQ(write(0.1, 0.1, 0.1), 0);
  FakeGpio::instance().line("481ae000", 17).use_error = -EIO;
  EXPECT_EQ(tickAndRead().health, uint32_t{RIO_BRIDGE_FAULT});
}

TEST_F(BbbWiringTest, OneMotorIsARobotToo) {
  config_.motors = 1;
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  EXPECT_EQ(duties(), (std::vector<std::string>{"25000", "0", "0"}));
  setAttribute(counter_[0], "count0/count", "12");
  const rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.encoder_counts[0], 12.0);
  EXPECT_EQ(sample.valid & RIO_ENCODERS, uint32_t{RIO_ENCODERS});
}

TEST_F(BbbWiringTest, SoManyMotorsAsTheBoundaryHasAreARobotToo) {
  static_assert(RIO_MAX_MOTORS == 4);
  const std::string fourth = addCounter("48306180", 3);
  config_.motors = 4;
  config_.motor[3] = config_.motor[2];
  config_.motor[3].in1 = pin_of("481ac000", 20);
  config_.motor[3].in2 = pin_of("481ac000", 21);
  config_.motor[3].fault.used = false;
  config_.motor[3].pwm_channel = 1;
  snprintf(config_.motor[3].encoder, sizeof config_.motor[3].encoder, "48306180");
  open();
  const rio_motors_t command{{0.5, 0.5, 0.5, -0.25}, true};
  ASSERT_EQ(rio_write_motors(&io_, &command), 0);
  EXPECT_EQ(attribute(pwm_[1], "pwm1/duty_cycle"), "12500");
  EXPECT_TRUE(FakeGpio::instance().line("481ac000", 21).active);
  setAttribute(fourth, "count0/count", "44");
  EXPECT_EQ(tickAndRead().encoder_counts[3], -44.0) << "reversed in the board file";
  rio_close(&io_);
  io_ = {};
  expectMotorsOff();
  EXPECT_EQ(attribute(pwm_[1], "pwm1/duty_cycle"), "0");
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}

TEST_F(BbbWiringTest, ReversedMotorsTurnTheOtherWay) {
  config_.motor[0].motor_reversed = true;
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  EXPECT_FALSE(FakeGpio::instance().line("4804c000", 28).active);
  EXPECT_TRUE(FakeGpio::instance().line("44e07000", 31).active);
  EXPECT_TRUE(FakeGpio::instance().line("4804c000", 16).active);
}

TEST_F(BbbWiringTest, ReadyIsTheEdgeThatTheBoardFileNames) {
  open();
  EXPECT_EQ(FakeGpio::instance().line("481ae000", 21).edge, GPIO_FALLING);
  EXPECT_EQ(imu.reg(0x37), 0x80);
  rio_close(&io_);
  config_.imu.interrupt.active_low = false;
  open();
  EXPECT_EQ(FakeGpio::instance().line("481ae000", 21).edge, GPIO_RISING);
  EXPECT_EQ(imu.reg(0x37), 0x00);
}

TEST_F(BbbWiringTest, WithoutAnEnableLineTheBridgesAreAlwaysAwake) {
  config_.enable.used = false;
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  EXPECT_EQ(duties()[0], "25000");
  FakeGpio::instance().line("4804c000", 17).active = true;
  ASSERT_EQ(write(1.0, 0.0, 0.0), 0);
  EXPECT_EQ(tickAndRead().health, uint32_t{RIO_BRIDGE_FAULT}) << "watched as soon as it drives";
}

TEST_F(BbbWiringTest, AnEnableLineThatFailsOnWakingStopsEverything) {
  open();
  enableLine().use_error = -EIO;
  EXPECT_EQ(write(0.5, 0.5, 0.5), -EIO);
  EXPECT_EQ(duties(), (std::vector<std::string>{"0", "0", "0"}));
  enableLine().use_error = 0;
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  EXPECT_TRUE(enableLine().active);
}

TEST_F(BbbWiringTest, EveryTickIsOnePeriodAfterTheLast) {
  config_.imu.rate_hz = 100;
  config_.imu.late_after_us = 2000;
  open();
  tickAndRead();
  int64_t now_ns = 0;
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  EXPECT_EQ(FakeGpio::instance().last_deadline_ns, edge_ns_ + 10000000 + 2000000);
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  EXPECT_EQ(FakeGpio::instance().last_deadline_ns, edge_ns_ + 2 * 10000000 + 2000000);
  const rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.t_ns, edge_ns_);
  EXPECT_EQ(sample.health & RIO_IMU_LATE, 0u) << "back again";
}

TEST_F(BbbWiringTest, TheFirstTickIsCountedFromTheOpening) {
  const int64_t before_ns = monotonic_ns();
  open();
  const int64_t after_ns = monotonic_ns();
  rio_sensors_t sample{};
  ASSERT_EQ(rio_read_sensors(&io_, &sample), 0);
  EXPECT_GE(sample.t_ns, before_ns);
  EXPECT_LE(sample.t_ns, after_ns);
  int64_t now_ns = 0;
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  const int64_t limit_ns = 5000000 + 1000000;  // a period, and what an edge may be late
  EXPECT_EQ(FakeGpio::instance().last_deadline_ns, sample.t_ns + limit_ns);
}

TEST_F(BbbWiringTest, TicksDoNotQueueBehindAStall) {
  open();
  tickAndRead();
  sleep_ms(50);
  int64_t now_ns = 0;
  const int64_t before_ns = monotonic_ns();
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  EXPECT_GE(FakeGpio::instance().last_deadline_ns, before_ns + 5000000) << "not ten late ticks at once";
}

TEST_F(BbbWiringTest, TellsWhatItIs) {
  imu.setWhoAmI(0x73);
  open();
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.who_am_i, 0x73);
  EXPECT_TRUE(status.imu_variant);
  EXPECT_FALSE(status.has_dmp);
  rio_close(&io_);
  imu.setWhoAmI(0x71);
  const std::string path = writeFile("dmp.bin", std::string(3062, 'x'));
  snprintf(config_.imu.dmp_firmware, sizeof config_.imu.dmp_firmware, "%s", path.c_str());
  open();
  bbb_get_status(&io_, &status);
  EXPECT_FALSE(status.imu_variant);
  EXPECT_TRUE(status.has_dmp);
}

TEST_F(BbbWiringTest, TheDmpNeedsItsRangeAndRate) {
  snprintf(config_.imu.dmp_firmware, sizeof config_.imu.dmp_firmware, "/nonexistent");
  const bbb_imu_t good = config_.imu;
  config_.imu.gyro_range_dps = 1000;
  EXPECT_THAT(complaint(-EINVAL), ::testing::HasSubstr("dmp: needs"));
  config_.imu = good;
  config_.imu.rate_hz = 100;
  EXPECT_THAT(complaint(-EINVAL), ::testing::HasSubstr("dmp: needs"));
  config_.imu = good;
  config_.imu.accel_range_g = 16;
  EXPECT_THAT(complaint(-EINVAL), ::testing::HasSubstr("dmp: needs"));
}

TEST_F(BbbWiringTest, WhatTheBoardFileMayNotSayIsNamed) {
  const bbb_config_t good = config_;
  config_.imu.interrupt.used = false;
  EXPECT_THAT(complaint(-EINVAL), ::testing::HasSubstr("imu interrupt"));
  config_ = good;
  config_.battery_every_ticks = 0;
  EXPECT_THAT(complaint(-EINVAL), ::testing::HasSubstr("battery_every_ticks"));
  config_ = good;
  config_.pwm_hz = 99;
  EXPECT_THAT(complaint(-EINVAL), ::testing::HasSubstr("pwm_hz"));
  config_ = good;
  FakeGpio::instance().line("4804c000", 28).open_error = -EBUSY;
  EXPECT_THAT(complaint(-EBUSY), ::testing::HasSubstr("motor 1 in1: gpio chip 4804c000 line 28"));
}

TEST_F(BbbWiringTest, AnErrorIsOneLineWithWhatToDoAboutIt) {
  imu.setWhoAmI(0);
  EXPECT_EQ(
      complaint(-ENODEV),
      "imu: /dev/i2c-2 address 0x68: No such device (ENODEV): driver or device tree node missing, or chip "
      "not answering as itself");
  imu.setWhoAmI(0x71);
  removeAttribute(adc_, "in_voltage6_raw");
  EXPECT_EQ(complaint(-ENOENT),
            "battery adc: TI-am335x-adc in_voltage6_raw: No such file or directory (ENOENT)");
  EXPECT_EQ(bbb_open(&config_, &io_, nullptr), -ENOENT) << "who does not ask is not told";
}

TEST_F(BbbWiringTest, LongNamesAreToldWhole) {
  const bbb_config_t good = config_;
  const std::string longest(BBB_NAME_MAX - 1, 'n');
  const auto name = [&](char(&field)[BBB_NAME_MAX]) { longest.copy(field, BBB_NAME_MAX); };
  name(config_.adc);
  config_.battery_channel = 4294967295;
  EXPECT_THAT(complaint(-ENODEV), ::testing::HasSubstr(longest + " in_voltage4294967295_raw"));
  config_ = good;
  name(config_.enable.chip);
  config_.enable.line = 4294967295;
  FakeGpio::instance().line(longest, 4294967295).open_error = -ENODEV;
  EXPECT_THAT(complaint(-ENODEV), ::testing::HasSubstr("gpio chip " + longest + " line 4294967295"));
  config_ = good;
  name(config_.imu.bus);
  config_.imu.address = 0xFFFF;
  EXPECT_THAT(complaint(-ENOENT), ::testing::HasSubstr(longest + " address 0xffff"));
  config_ = good;
  name(config_.motor[1].encoder);
  EXPECT_THAT(complaint(-ENODEV), ::testing::HasSubstr("encoder 2 eQEP: " + longest));
  config_ = good;
  name(config_.motor[2].pwm);
  EXPECT_THAT(complaint(-ENODEV), ::testing::HasSubstr("motor 3 pwm: " + longest + " channel 0"));
}

TEST_F(BbbWiringTest, ABatteryThatComesBackIsBelievedAgain) {
  config_.battery_every_ticks = 1;
  open();
  setAttribute(adc_, "in_voltage6_raw", "1000");
  SyscallJournal::instance().failRead("in_voltage6_raw", EIO);
  EXPECT_EQ(tickAndRead().health, uint32_t{RIO_BATTERY_ERROR});
  const rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.health, 0u);
  EXPECT_EQ(sample.battery_counts, 1000.0);
}
