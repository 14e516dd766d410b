#include "adc.h"

#include <errno.h>

#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
class AdcTest : public Testbed {
 protected:
  void TearDown() override { adc_close(&adc_); }
  adc_t adc_{-1};
};
}  // namespace

TEST_F(AdcTest, ReadsItsChannelOfTheNamedDevice) {
  addAdc("bmp280", 0);
  const std::string dir = addAdc("TI-am335x-adc.0.auto", 1);
  setAttribute(dir, "in_voltage6_raw", "1700");
  ASSERT_EQ(adc_open(&adc_, "TI-am335x-adc", 6), 0);
  int32_t counts = 0;
  ASSERT_EQ(adc_read(&adc_, &counts), 0);
  EXPECT_EQ(counts, 1700);
  setAttribute(dir, "in_voltage6_raw", "4095");
  ASSERT_EQ(adc_read(&adc_, &counts), 0);
  EXPECT_EQ(counts, 4095);
}

TEST_F(AdcTest, DescriptorZeroIsOneLikeAnyOtherAndIsClosedOnce) {
  addAdc("TI-am335x-adc", 0);
  const NoStdin none;
  ASSERT_EQ(adc_open(&adc_, "TI-am335x-adc", 0), 0);
  EXPECT_EQ(adc_.fd, 0);
  adc_close(&adc_);
  EXPECT_EQ(adc_.fd, -1);
  adc_close(&adc_);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
}

TEST_F(AdcTest, ReportsMissingDeviceAndChannel) {
  adc_.fd = 77;
  EXPECT_EQ(adc_open(&adc_, "TI-am335x-adc", 6), -ENODEV);
  EXPECT_EQ(adc_.fd, -1) << "whatever was there before";
  addAdc("TI-am335x-adc", 0);
  EXPECT_EQ(adc_open(&adc_, "TI-am335x-adc", 8), -ENOENT);
}

TEST_F(AdcTest, ReportsImpossibleCountsAndErrors) {
  const std::string dir = addAdc("TI-am335x-adc", 0);
  ASSERT_EQ(adc_open(&adc_, "TI-am335x-adc", 0), 0);
  int32_t counts = 77;
  setAttribute(dir, "in_voltage0_raw", "4096");
  EXPECT_EQ(adc_read(&adc_, &counts), -ERANGE);
  setAttribute(dir, "in_voltage0_raw", "-1");
  EXPECT_EQ(adc_read(&adc_, &counts), -ERANGE);
  SyscallJournal::instance().failRead("in_voltage0_raw", ETIMEDOUT);
  EXPECT_EQ(adc_read(&adc_, &counts), -ETIMEDOUT);
  SyscallJournal::instance().failRead("in_voltage0_raw", 0);
  EXPECT_EQ(adc_read(&adc_, &counts), -EBADMSG);
  EXPECT_EQ(counts, 77);
}
