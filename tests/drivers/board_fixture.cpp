#include "board_fixture.hpp"

#include <monotonic.h>

#include "support/pin.hpp"

namespace {
bbb_motor_t motor(bbb_pin_t in1, bbb_pin_t in2, bbb_pin_t fault, const char* pwm, uint32_t channel,
                  const char* encoder) {
  bbb_motor_t out{};
  out.bridge = BBB_MC33926;
  out.in1 = in1;
  out.in2 = in2;
  out.fault = fault;
  snprintf(out.pwm, sizeof out.pwm, "%s", pwm);
  out.pwm_channel = channel;
  snprintf(out.encoder, sizeof out.encoder, "%s", encoder);
  return out;
}

constexpr const char *kGpio0 = "44e07000", *kGpio1 = "4804c000", *kGpio2 = "481ac000", *kGpio3 = "481ae000";
}  // namespace

void BoardFixture::SetUp() {
  addImu();
  pwm_[0] = addPwm("48302200", 4);
  pwm_[1] = addPwm("48304200", 7);
  counter_[0] = addCounter("48300180", 2);
  counter_[1] = addCounter("48302180", 0);
  counter_[2] = addCounter("48304180", 1);
  adc_ = addAdc("TI-am335x-adc.0.auto", 0);
  resetBoard();
}

void BoardFixture::resetBoard() {
  FakeGpio::instance().clear();
  SyscallJournal::instance().clear();
  imu.setWhoAmI(0x71);
  imu.failNext(0, 0);
  for (const std::string& dir : counter_) setAttribute(dir, "count0/ceiling", "0");
  setAttribute(adc_, "in_voltage6_raw", "0");
  config_ = bbb_config_t{};
  bbb_imu_t& c = config_.imu;
  snprintf(c.bus, sizeof c.bus, "/dev/i2c-2");
  c.address = 0x68;
  c.rate_hz = 200;
  c.gyro_range_dps = 2000;
  c.accel_range_g = 8;
  c.dlpf = 2;
  c.interrupt = pin_of(kGpio3, 21, true);
  c.late_after_us = 1000;
  config_.motors = 3;
  config_.motor[0] =
      motor(pin_of(kGpio1, 28), pin_of(kGpio0, 31), pin_of(kGpio1, 17, true), "48302200", 0, "48300180");
  config_.motor[1] =
      motor(pin_of(kGpio1, 16), pin_of(kGpio2, 17), pin_of(kGpio3, 17, true), "48302200", 1, "48302180");
  config_.motor[2] =
      motor(pin_of(kGpio2, 9), pin_of(kGpio2, 8), pin_of(kGpio3, 16, true), "48304200", 0, "48304180");
  config_.motor[2].encoder_reversed = true;
  config_.pwm_hz = 20000;
  config_.enable = pin_of(kGpio0, 20);
  snprintf(config_.adc, sizeof config_.adc, "TI-am335x-adc");
  config_.battery_channel = 6;
  config_.battery_every_ticks = 20;
}

void BoardFixture::open() {
  bbb_error_t error{};
  ASSERT_EQ(bbb_open(&config_, &io_, &error), 0) << error.text;
}

rio_sensors_t BoardFixture::tickAndRead() {
  edge_ns_ = monotonic_ns();
  FakeGpio::instance().edges_ns = {edge_ns_};
  int64_t now_ns = 0;
  EXPECT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  EXPECT_GE(now_ns, edge_ns_);
  rio_sensors_t sample{};
  EXPECT_EQ(rio_read_sensors(&io_, &sample), 0);
  return sample;
}

int BoardFixture::write(double first, double second, double third) {
  const rio_motors_t command{{first, second, third, 0.0}, true};
  return rio_write_motors(&io_, &command);
}

std::vector<std::string> BoardFixture::duties() const {
  return {attribute(pwm_[0], "pwm0/duty_cycle"), attribute(pwm_[0], "pwm1/duty_cycle"),
          attribute(pwm_[1], "pwm0/duty_cycle")};
}

void BoardFixture::expectMotorsOff() {
  EXPECT_EQ(duties(), (std::vector<std::string>{"0", "0", "0"}));
  EXPECT_FALSE(enableLine().active);
  for (const auto& [key, line] : FakeGpio::instance().lines()) {
    EXPECT_FALSE(line.output && line.active) << key.first << ":" << key.second;
  }
}
