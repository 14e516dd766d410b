#include "pwm.h"

#include <errno.h>

#include <cmath>
#include <limits>

#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
constexpr uint32_t kPeriod_ns = 50000;  // 20 kHz

class PwmTest : public Testbed {
 protected:
  void TearDown() override { pwm_close(&pwm_); }
  pwm_t pwm_{};
  PwmTest() { pwm_.duty_fd = -1; }
};
}  // namespace

TEST_F(PwmTest, SetsThePeriodBeforeItEnablesAtZero) {
  const std::string dir = addPwm("48302200", 4);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 1, kPeriod_ns), 0);
  EXPECT_EQ(SyscallJournal::instance().lines(),
            (std::vector<std::string>{"pwm1/period=50000", "pwm1/duty_cycle=0", "pwm1/enable=1"}));
  EXPECT_EQ(attribute(dir, "pwm1/period"), "50000");
}

TEST_F(PwmTest, StopsAWaveformLeftByAnotherProcessFirst) {
  const std::string dir = addPwm("48302200", 4);
  setAttribute(dir, "pwm0/period", "40000");
  setAttribute(dir, "pwm0/duty_cycle", "39000");
  setAttribute(dir, "pwm0/enable", "1");
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
  EXPECT_EQ(SyscallJournal::instance().lines(),
            (std::vector<std::string>{"pwm0/duty_cycle=0", "pwm0/enable=0", "pwm0/period=50000",
                                      "pwm0/duty_cycle=0", "pwm0/enable=1"}));
}

TEST_F(PwmTest, KnowsBothNamingsOfChannels) {
  const std::string dir = addPwm("48304200", 7, true);
  ASSERT_EQ(pwm_open(&pwm_, "48304200", 1, kPeriod_ns), 0);
  EXPECT_EQ(attribute(dir, "pwm-7:1/enable"), "1");
}

TEST_F(PwmTest, WritesOnTimesAndFractions) {
  const std::string dir = addPwm("48302200", 4);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
  ASSERT_EQ(pwm_set_fraction(&pwm_, 0.25), 0);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "12500");
  ASSERT_EQ(pwm_set_fraction(&pwm_, 1.0), 0);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "50000");
  ASSERT_EQ(pwm_set_ns(&pwm_, 7), 0);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "7");
}

TEST_F(PwmTest, RefusesOnTimesBeyondThePeriodAndNonNumbers) {
  addPwm("48302200", 4);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
  SyscallJournal::instance().clear();
  EXPECT_EQ(pwm_set_ns(&pwm_, kPeriod_ns + 1), -EINVAL);
  for (const double fraction : {-0.1, 1.1, double(NAN), double(INFINITY)}) {
    EXPECT_EQ(pwm_set_fraction(&pwm_, fraction), -EINVAL) << fraction;
  }
  EXPECT_TRUE(SyscallJournal::instance().lines().empty());
}

TEST_F(PwmTest, RefusesAPeriodThatDiffersFromTheRunningSibling) {
  const std::string dir = addPwm("48302200", 4);
  setAttribute(dir, "pwm0/period", "40000");
  setAttribute(dir, "pwm0/enable", "1");
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 1, kPeriod_ns), -EINVAL);
  EXPECT_EQ(attribute(dir, "pwm1/enable"), "0") << "untouched";
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 1, 40000), 0);
}

TEST_F(PwmTest, ClosesAtZeroAndDisabled) {
  const std::string dir = addPwm("48302200", 4);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
  ASSERT_EQ(pwm_set_fraction(&pwm_, 0.5), 0);
  pwm_close(&pwm_);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "0");
  EXPECT_EQ(attribute(dir, "pwm0/enable"), "0");
  EXPECT_EQ(attribute(dir, "unexport"), "") << "who did not export does not unexport";
}

TEST_F(PwmTest, ReportsMissingChipChannelAndAttributes) {
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), -ENODEV);
  const std::string dir = addPwm("48302200", 4);
  removeAttribute(dir, "pwm0/duty_cycle");
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), -ENOENT);
  removeAttribute(dir, "pwm1");  // its export shows no effect here
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 1, kPeriod_ns), -ENOENT);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 2, kPeriod_ns), -EINVAL);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, 0), -EINVAL);
}

TEST_F(PwmTest, ReportsWhatTheKernelRefuses) {
  const std::string dir = addPwm("48302200", 4);
  SyscallJournal::instance().failWrite("pwm0/period", EINVAL);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), -EINVAL);
  SyscallJournal::instance().failWrite("pwm0/enable", EACCES);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), -EACCES);
  removeAttribute(dir, "pwm1");
  SyscallJournal::instance().failWrite("pwmchip4/export", EPERM);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 1, kPeriod_ns), -EPERM);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
  SyscallJournal::instance().failWrite("pwm0/duty_cycle", ENODEV);
  EXPECT_EQ(pwm_set_fraction(&pwm_, 0.1), -ENODEV);
}

TEST_F(PwmTest, ExportsAChannelThatIsNotThereAndUnexportsIt) {
  const std::string dir = addPwm("48302200", 4);
  removeAttribute(dir, "pwm1");
  const auto answer = [&] {
    for (const char* name : {"pwm1/period", "pwm1/duty_cycle", "pwm1/enable"}) setAttribute(dir, name, "0");
  };
  SyscallJournal::instance().onWrite("pwmchip4/export", answer);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 1, kPeriod_ns), 0);
  EXPECT_EQ(SyscallJournal::instance().lines(),
            (std::vector<std::string>{"pwmchip4/export=1", "pwm1/period=50000", "pwm1/duty_cycle=0",
                                      "pwm1/enable=1"}));
  pwm_close(&pwm_);
  EXPECT_EQ(SyscallJournal::instance().lines().back(), "pwmchip4/unexport=1");
  EXPECT_EQ(attribute(dir, "pwm1/enable"), "0") << "first";
}

TEST_F(PwmTest, AChannelThatAnotherExportsMeanwhileIsNotUnexported) {
  const std::string dir = addPwm("48302200", 4);
  removeAttribute(dir, "pwm1");
  SyscallJournal::instance().failWrite("pwmchip4/export", EBUSY);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 1, kPeriod_ns), -ENOENT);
  EXPECT_EQ(attribute(dir, "unexport"), "");
}

TEST_F(PwmTest, WaitsUntilUdevHasHandedTheAttributesOver) {
  addPwm("48302200", 4);
  SyscallJournal::instance().failOpen("pwm0/period", EACCES, 2);
  SyscallJournal::instance().failOpen("pwm0/enable", EACCES, 1);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
}

TEST_F(PwmTest, ASiblingThatRestsMayHaveAnotherPeriod) {
  const std::string dir = addPwm("48302200", 4);
  setAttribute(dir, "pwm1/period", "40000");
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
  removeAttribute(dir, "pwm1/enable");
  pwm_close(&pwm_);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
}

TEST_F(PwmTest, LeavesNoDescriptorOpenWhetherItOpensOrNot) {
  const SyscallJournal& journal = SyscallJournal::instance();
  addPwm("48302200", 4);
  {
    const NoStdin none;
    ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
    EXPECT_EQ(pwm_.duty_fd, 0) << "a descriptor like any other";
    EXPECT_EQ(journal.openFiles(), 1) << "the on-time's, kept for the tick";
    ASSERT_EQ(pwm_set_ns(&pwm_, kPeriod_ns), 0);
    pwm_close(&pwm_);
    EXPECT_EQ(journal.lines().back(), "pwm0/enable=0");
    EXPECT_EQ(journal.lines()[journal.lines().size() - 2], "pwm0/duty_cycle=0");
  }
  EXPECT_EQ(pwm_.duty_fd, -1);
  pwm_close(&pwm_);
  SyscallJournal::instance().failWrite("pwm0/enable", EIO);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), -EIO);
  EXPECT_EQ(pwm_.duty_fd, -1);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, 0), -EINVAL);
  EXPECT_EQ(pwm_.duty_fd, -1);
  EXPECT_EQ(journal.openFiles(), 0);
  EXPECT_EQ(journal.strayCloses(), 0);
}

TEST_F(PwmTest, WhatFailsAfterItsExportIsUndone) {
  const SyscallJournal& journal = SyscallJournal::instance();
  const std::string dir = addPwm("48302200", 4);
  SyscallJournal::instance().failWrite("pwm0/enable", EIO);  // the last step
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), -EIO);
  EXPECT_EQ(pwm_.duty_fd, -1);
  EXPECT_EQ(journal.openFiles(), 0);
  EXPECT_EQ(attribute(dir, "unexport"), "") << "it was there before";
  removeAttribute(dir, "pwm1");
  const auto answer = [&] {
    for (const char* name : {"pwm1/period", "pwm1/duty_cycle", "pwm1/enable"}) setAttribute(dir, name, "0");
  };
  SyscallJournal::instance().onWrite("pwmchip4/export", answer);
  SyscallJournal::instance().failWrite("pwm1/period", EINVAL);
  EXPECT_EQ(pwm_open(&pwm_, "48302200", 1, kPeriod_ns), -EINVAL);
  EXPECT_EQ(attribute(dir, "unexport"), "1");
  EXPECT_EQ(journal.openFiles(), 0);
  EXPECT_EQ(journal.strayCloses(), 0);
}

TEST_F(PwmTest, TheWholePeriodAndNothingAreInRange) {
  const std::string dir = addPwm("48302200", 4);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, kPeriod_ns), 0);
  EXPECT_EQ(pwm_set_ns(&pwm_, kPeriod_ns), 0);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "50000");
  EXPECT_EQ(pwm_set_ns(&pwm_, 0), 0);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "0");
  for (const double beyond : {std::nextafter(1.0, 2.0), -std::numeric_limits<double>::denorm_min()})
    EXPECT_EQ(pwm_set_fraction(&pwm_, beyond), -EINVAL) << beyond;
}

TEST_F(PwmTest, RoundsFractionsToTheNearestNanosecond) {
  const std::string dir = addPwm("48302200", 4);
  ASSERT_EQ(pwm_open(&pwm_, "48302200", 0, 1000), 0);
  ASSERT_EQ(pwm_set_fraction(&pwm_, 0.0016), 0);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "2");
  ASSERT_EQ(pwm_set_fraction(&pwm_, 0.0), 0);
  EXPECT_EQ(attribute(dir, "pwm0/duty_cycle"), "0");
}
