#include "cutoff.h"

#include <errno.h>

#include "board_fixture.hpp"

namespace {
class CutoffTest : public BoardFixture {
 protected:
  void TearDown() override {
    BoardFixture::TearDown();
    cutoff_close(&cutoff_);
  }
  void openBoth() {
    bbb_error_t error{};
    ASSERT_EQ(cutoff_open(&cutoff_, &config_, &error), 0) << error.text;
    config_.enable_held_elsewhere = true;
    open();
  }
  cutoff_t cutoff_{};
};
}  // namespace

TEST_F(CutoffTest, StopsAProcessThatNoLongerCan) {
  openBoth();
  ASSERT_EQ(cutoff_enable(&cutoff_), 0);
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  EXPECT_EQ(duties(), (std::vector<std::string>{"25000", "25000", "25000"}));
  EXPECT_TRUE(enableLine().active);
  ASSERT_EQ(cutoff_off(&cutoff_), 0);
  EXPECT_EQ(duties(), (std::vector<std::string>{"0", "0", "0"}));
  EXPECT_FALSE(enableLine().active);
}

TEST_F(CutoffTest, TriesEverythingWhenAPartFails) {
  openBoth();
  ASSERT_EQ(cutoff_enable(&cutoff_), 0);
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  SyscallJournal::instance().failWrite("pwmchip4/pwm0/duty_cycle", EIO);
  enableLine().use_error = -ENODEV;
  EXPECT_EQ(cutoff_off(&cutoff_), -ENODEV) << "the first error is told";
  EXPECT_EQ(duties()[1], "0");
  EXPECT_EQ(duties()[2], "0");
}

TEST_F(CutoffTest, NamesWhatItCannotOpen) {
  bbb_error_t error{};
  enableLine().open_error = -EBUSY;
  EXPECT_EQ(cutoff_open(&cutoff_, &config_, &error), -EBUSY);
  EXPECT_THAT(error.text, ::testing::HasSubstr("44e07000"));
  enableLine().open_error = 0;
  config_.motor[1].pwm[0] = 'x';
  EXPECT_EQ(cutoff_open(&cutoff_, &config_, &error), -ENODEV);
  EXPECT_THAT(error.text, ::testing::HasSubstr("x8302200"));
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
}

TEST_F(CutoffTest, RefusesABoardWithoutMotorsOrPwm) {
  const auto refused = [this](auto&& change) {
    bbb_config_t config = config_;
    change(config);
    bbb_error_t error{};
    const int status = cutoff_open(&cutoff_, &config, &error);
    return status == -EINVAL && error.code == -EINVAL && FakeGpio::instance().heldLines() == 0;
  };
  EXPECT_TRUE(refused([](auto& c) { c.motors = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.motors = RIO_MAX_MOTORS + 1; }));
  EXPECT_TRUE(refused([](auto& c) { c.pwm_hz = 0; }));
  bbb_error_t error{};
  config_.motors = RIO_MAX_MOTORS;
  config_.motor[3] = config_.motor[2];
  config_.motor[3].pwm_channel = 1;
  EXPECT_EQ(cutoff_open(&cutoff_, &config_, &error), 0) << error.text;
}

TEST_F(CutoffTest, WorksWithoutAnEnableLine) {
  config_.enable.used = false;
  bbb_error_t error{};
  ASSERT_EQ(cutoff_open(&cutoff_, &config_, &error), 0) << error.text;
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  EXPECT_EQ(cutoff_enable(&cutoff_), 0);
  EXPECT_EQ(cutoff_off(&cutoff_), 0);
  SyscallJournal::instance().failWrite("pwmchip4/pwm1/duty_cycle", EIO);
  EXPECT_EQ(cutoff_off(&cutoff_), -EIO);
}

TEST_F(CutoffTest, OpensAtRestAndClosesWithNothingHeld) {
  enableLine().active = true;
  bbb_error_t error{};
  ASSERT_EQ(cutoff_open(&cutoff_, &config_, &error), 0) << error.text;
  EXPECT_FALSE(enableLine().active);
  EXPECT_EQ(attribute(pwm_[1], "pwm0/period"), "50000") << "20 kHz";
  ASSERT_EQ(cutoff_enable(&cutoff_), 0);
  cutoff_close(&cutoff_);
  EXPECT_FALSE(enableLine().active);
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(attribute(pwm_[1], "pwm0/enable"), "0");
}

TEST_F(CutoffTest, LeavesNothingBehindWhenTheLastMotorIsMissing) {
  config_.motor[2].pwm[0] = 'x';
  bbb_error_t error{};
  EXPECT_EQ(cutoff_open(&cutoff_, &config_, &error), -ENODEV);
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(attribute(pwm_[0], "pwm1/enable"), "0");
}
