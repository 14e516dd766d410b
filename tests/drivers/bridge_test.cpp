// Both motor bridges: order of writes, refusal, coasting whatever fails, and the status flag's statistics.
#include <errno.h>

#include <cmath>
#include <random>

#include "fake_gpio.hpp"
#include "mc33926.h"
#include "syscall_journal.hpp"
#include "tb6612.h"
#include "testbed.hpp"

namespace {
using Lines = std::vector<std::string>;

class BridgeTest : public Testbed {
 protected:
  void SetUp() override {
    FakeGpio::instance().clear();
    dir_ = addPwm("48302200", 4);
  }
  void TearDown() override { mc33926_close(&motor_); }
  void open(const gpio_pin_t* flag = nullptr) {
    ASSERT_EQ(mc33926_open(&motor_, &config_, flag, nullptr), 0);
    SyscallJournal::instance().clear();
  }
  FakeGpio::Line& in1() { return FakeGpio::instance().line("gpio1", 28); }
  FakeGpio::Line& in2() { return FakeGpio::instance().line("gpio0", 31); }
  std::string duty() { return attribute(dir_, "pwm0/duty_cycle"); }

  hbridge_config_t config_ = {{"gpio1", 28, false}, {"gpio0", 31, false}, "48302200", 0, 50000, false};
  const gpio_pin_t flag_ = {"gpio1", 17, true};
  mc33926_t motor_{};
  std::string dir_;
  BridgeTest() { motor_.bridge.pwm.duty_fd = -1; }
};
}  // namespace

TEST_F(BridgeTest, ForwardIsIn1HighReverseIsIn2High) {
  open();
  ASSERT_EQ(mc33926_write(&motor_, 0.5), 0);
  EXPECT_EQ(SyscallJournal::instance().lines(),
            (Lines{"pwm0/duty_cycle=0", "gpio0:31=0", "gpio1:28=1", "pwm0/duty_cycle=25000"}));
  ASSERT_EQ(mc33926_write(&motor_, -0.25), 0);
  EXPECT_FALSE(in1().active);
  EXPECT_TRUE(in2().active);
  EXPECT_EQ(duty(), "12500");
}

TEST_F(BridgeTest, DirectionNeverChangesUnderPower) {
  open();
  ASSERT_EQ(mc33926_write(&motor_, 1.0), 0);
  SyscallJournal::instance().clear();
  ASSERT_EQ(mc33926_write(&motor_, -1.0), 0);
  EXPECT_EQ(SyscallJournal::instance().lines(),
            (Lines{"pwm0/duty_cycle=0", "gpio1:28=0", "gpio0:31=1", "pwm0/duty_cycle=50000"}));
  SyscallJournal::instance().clear();
  ASSERT_EQ(mc33926_write(&motor_, -0.5), 0);
  EXPECT_EQ(SyscallJournal::instance().lines(), (Lines{"pwm0/duty_cycle=25000"}))
      << "same direction: one write";
}

TEST_F(BridgeTest, ReversedLeadsSwapTheDirection) {
  config_.reversed = true;
  open();
  ASSERT_EQ(mc33926_write(&motor_, 0.5), 0);
  EXPECT_FALSE(in1().active);
  EXPECT_TRUE(in2().active);
}

TEST_F(BridgeTest, RefusesNonsenseAndStops) {
  open();
  for (const double bad : {1.01, -2.0, double(NAN), double(INFINITY)}) {
    ASSERT_EQ(mc33926_write(&motor_, 0.7), 0);
    EXPECT_EQ(mc33926_write(&motor_, bad), -EINVAL) << bad;
    EXPECT_EQ(duty(), "0");
    EXPECT_FALSE(in1().active || in2().active);
  }
}

TEST_F(BridgeTest, CoastTriesEverythingAndReportsTheFirstError) {
  open();
  ASSERT_EQ(mc33926_write(&motor_, 0.7), 0);
  SyscallJournal::instance().failWrite("pwm0/duty_cycle", EIO);
  EXPECT_EQ(mc33926_coast(&motor_), -EIO);
  EXPECT_FALSE(in1().active) << "the direction lines went low all the same";
  ASSERT_EQ(mc33926_write(&motor_, 0.7), 0);
  in2().use_error = -ENODEV;
  EXPECT_EQ(mc33926_coast(&motor_), -ENODEV);
  EXPECT_EQ(duty(), "0");
}

TEST_F(BridgeTest, ADirectionLineThatFailsKeepsTheDutyAtZero) {
  open();
  in1().use_error = -EIO;
  EXPECT_EQ(mc33926_write(&motor_, 0.7), -EIO);
  EXPECT_EQ(duty(), "0");
  in1().use_error = 0;
  EXPECT_EQ(mc33926_write(&motor_, 0.7), 0) << "and is tried again";
  EXPECT_TRUE(in1().active);
}

TEST_F(BridgeTest, CloseCoasts) {
  open();
  ASSERT_EQ(mc33926_write(&motor_, 0.7), 0);
  mc33926_close(&motor_);
  EXPECT_EQ(duty(), "0");
  EXPECT_EQ(attribute(dir_, "pwm0/enable"), "0");
  EXPECT_FALSE(in1().active || in2().active);
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
}

TEST_F(BridgeTest, NamesThePartThatFailedAndReleasesTheRest) {
  const char* culprit = nullptr;
  in2().open_error = -EBUSY;
  EXPECT_EQ(mc33926_open(&motor_, &config_, nullptr, &culprit), -EBUSY);
  EXPECT_STREQ(culprit, "in2");
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  EXPECT_EQ(attribute(dir_, "pwm0/enable"), "0");
  in2().open_error = 0;
  FakeGpio::instance().line("gpio1", 17).open_error = -ENODEV;
  EXPECT_EQ(mc33926_open(&motor_, &config_, &flag_, &culprit), -ENODEV);
  EXPECT_STREQ(culprit, "status_flag");
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  removeDevice(dir_);
  EXPECT_EQ(mc33926_open(&motor_, &config_, nullptr, &culprit), -ENODEV);
  EXPECT_STREQ(culprit, "pwm");
}

TEST_F(BridgeTest, RefusesPwmBeyondTheBridge) {
  config_.period_ns = 40000;  // 25 kHz, the cape library's default
  EXPECT_EQ(mc33926_open(&motor_, &config_, nullptr, nullptr), -EINVAL);
  tb6612_t cape{};
  config_.period_ns = 9000;
  EXPECT_EQ(tb6612_open(&cape, &config_, nullptr), -EINVAL);
}

TEST_F(BridgeTest, CapeBridgeBrakesAtZeroAndFloatsWhenCoasting) {
  tb6612_t cape{};
  ASSERT_EQ(tb6612_open(&cape, &config_, nullptr), 0);
  ASSERT_EQ(tb6612_write(&cape, -0.5), 0);
  ASSERT_EQ(tb6612_write(&cape, 0.0), 0);
  EXPECT_TRUE(in2().active) << "inputs differ, PWM low: short brake";
  EXPECT_EQ(duty(), "0");
  ASSERT_EQ(tb6612_coast(&cape), 0);
  EXPECT_FALSE(in1().active || in2().active);
  tb6612_close(&cape);
}

TEST_F(BridgeTest, StatusFlagAtFullDutyIsAFaultAtOnce) {
  open(&flag_);
  FakeGpio::Line& flag = FakeGpio::instance().line("gpio1", 17);
  bool fault = false;
  flag.active = true;  // active low: SF is low
  ASSERT_EQ(mc33926_sample_fault(&motor_, &fault), 0);
  EXPECT_FALSE(fault) << "coasting: SF low means nothing";
  ASSERT_EQ(mc33926_write(&motor_, 1.0), 0);
  ASSERT_EQ(mc33926_sample_fault(&motor_, &fault), 0);
  EXPECT_TRUE(fault);
  EXPECT_EQ(motor_.fault.faults, 1u);
  ASSERT_EQ(mc33926_sample_fault(&motor_, &fault), 0);
  EXPECT_EQ(motor_.fault.faults, 1u) << "one event, not one per tick";
  flag.active = false;
  ASSERT_EQ(mc33926_sample_fault(&motor_, &fault), 0);
  EXPECT_FALSE(fault);
  flag.use_error = -EIO;
  EXPECT_EQ(mc33926_sample_fault(&motor_, &fault), -EIO);
}

TEST_F(BridgeTest, PwmUpToTheBridgesLimitAndNoFaster) {
  tb6612_t motor{};
  hbridge_config_t config = config_;
  config.period_ns = 1000000000u / TB6612_MAX_PWM_HZ;
  const char* culprit = nullptr;
  EXPECT_EQ(tb6612_open(&motor, &config, &culprit), 0);
  tb6612_close(&motor);
  --config.period_ns;
  EXPECT_EQ(tb6612_open(&motor, &config, &culprit), -EINVAL);
  EXPECT_STREQ(culprit, "pwm");
}

TEST_F(BridgeTest, MonsterBridgeTakesTwentyKilohertzAndNoMore) {
  const char* culprit = "?";
  config_.period_ns = 50000;
  EXPECT_EQ(mc33926_open(&motor_, &config_, nullptr, &culprit), 0);
  EXPECT_EQ(culprit, nullptr) << "nothing is to blame";
  mc33926_close(&motor_);
  config_.period_ns = 49999;
  EXPECT_EQ(mc33926_open(&motor_, &config_, nullptr, &culprit), -EINVAL);
  EXPECT_STREQ(culprit, "pwm");
}

TEST_F(BridgeTest, NamesTheFirstDirectionLineToo) {
  const char* culprit = nullptr;
  in1().open_error = -EBUSY;
  EXPECT_EQ(mc33926_open(&motor_, &config_, nullptr, &culprit), -EBUSY);
  EXPECT_STREQ(culprit, "in1");
  EXPECT_EQ(motor_.bridge.pwm.duty_fd, -1);
}

TEST_F(BridgeTest, CloseReleasesTheStatusFlag) {
  open(&flag_);
  EXPECT_EQ(FakeGpio::instance().heldLines(), 3);
  mc33926_close(&motor_);
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
}

TEST_F(BridgeTest, WithoutAStatusFlagThereIsNoFault) {
  open();
  ASSERT_EQ(mc33926_write(&motor_, 1.0), 0);
  bool fault = true;
  EXPECT_EQ(mc33926_sample_fault(&motor_, &fault), 0);
  EXPECT_FALSE(fault);
}

TEST_F(BridgeTest, AFailedWriteIsToldAndTheDirectionWrittenAnewAfterCoasting) {
  open();
  SyscallJournal::instance().failWrite("pwm0/duty_cycle", EIO);
  EXPECT_EQ(mc33926_write(&motor_, 0.5), -EIO);
  EXPECT_FALSE(in1().active) << "no direction before the duty is zero";
  ASSERT_EQ(mc33926_write(&motor_, 0.5), 0);
  ASSERT_EQ(mc33926_coast(&motor_), 0);
  EXPECT_FALSE(in1().active);
  ASSERT_EQ(mc33926_write(&motor_, 0.5), 0);
  EXPECT_TRUE(in1().active);
  in2().use_error = -EIO;
  EXPECT_EQ(mc33926_write(&motor_, -0.5), -EIO);
  EXPECT_EQ(duty(), "0");
  in2().use_error = 0;
  ASSERT_EQ(mc33926_write(&motor_, 0.5), 0);
  EXPECT_TRUE(in1().active);
}

TEST(Mc33926Fault, AHighFlagClearsTheEvidenceAndAStandingFaultStandsWhileCoasting) {
  mc33926_fault_filter_t filter{};
  for (int i = 0; i < 19; ++i) EXPECT_FALSE(mc33926_fault_update(&filter, 0.5, true)) << i;
  EXPECT_FALSE(mc33926_fault_update(&filter, 0.0, true)) << "coasting adds nothing";
  EXPECT_FALSE(mc33926_fault_update(&filter, 0.5, false));
  for (int i = 0; i < 19; ++i) EXPECT_FALSE(mc33926_fault_update(&filter, 0.5, true)) << i;
  EXPECT_TRUE(mc33926_fault_update(&filter, 0.5, true));
  EXPECT_TRUE(mc33926_fault_update(&filter, 0.0, false)) << "still";
  EXPECT_FALSE(mc33926_fault_update(&filter, -1.0, false));
  EXPECT_FALSE(mc33926_fault_update(&filter, 0.0, true));
  EXPECT_EQ(filter.faults, 1u);
  EXPECT_TRUE(mc33926_fault_update(&filter, -1.0, true));
  EXPECT_EQ(filter.faults, 2u);
}

TEST(Mc33926Fault, HealthyBridgesDoNotTripAtAnyDuty) {
  // SF of a healthy bridge is low whenever the sample falls into a coast phase: 1 h at 200 Hz per duty.
  std::mt19937 random(1);
  std::uniform_real_distribution<double> phase(0.0, 1.0);
  for (const double duty : {0.05, 0.3, 0.6, 0.95}) {
    mc33926_fault_filter_t filter{};
    for (int i = 0; i < 720000; ++i) mc33926_fault_update(&filter, duty, phase(random) >= duty);
    EXPECT_LE(filter.faults, 1u) << duty;
  }
}

TEST(Mc33926Fault, AShortedBridgeTripsSoonerTheHarderItIsDriven) {
  const auto samplesUntilFault = [](double duty) {
    mc33926_fault_filter_t filter{};
    int samples = 1;
    while (!mc33926_fault_update(&filter, duty, true)) ++samples;
    return samples;
  };
  EXPECT_EQ(samplesUntilFault(1.0), 1);
  EXPECT_EQ(samplesUntilFault(-0.5), 20);  // 20 bits at 1 bit each
  EXPECT_EQ(samplesUntilFault(0.75), 10);  // at 2 bits each
  EXPECT_EQ(samplesUntilFault(0.1), 132);  // at 0.152 bits each: 0.66 s
}
