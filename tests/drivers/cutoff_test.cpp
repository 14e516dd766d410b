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
  enableLine().use_error = -EIO;
  EXPECT_EQ(cutoff_off(&cutoff_), -EIO);
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
