#include "eqep.h"

#include <errno.h>

#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
constexpr uint64_t k32 = uint64_t{1} << 32;

class EqepTest : public Testbed {
 protected:
  void TearDown() override { eqep_close(&encoder_); }
  int64_t readAfter(const std::string& dir, const std::string& name, const std::string& value) {
    setAttribute(dir, name, value);
    int64_t counts = -999;
    EXPECT_EQ(eqep_read(&encoder_, &counts), 0);
    return counts;
  }
  eqep_t encoder_{-1, 0, 0, 0};
};
}  // namespace

TEST(EqepDifference, TakesTheShorterWayAround) {
  EXPECT_EQ(eqep_difference(0, 5, k32), 5);
  EXPECT_EQ(eqep_difference(5, 0, k32), -5);
  EXPECT_EQ(eqep_difference(k32 - 2, 3, k32), 5);
  EXPECT_EQ(eqep_difference(3, k32 - 2, k32), -5);
  EXPECT_EQ(eqep_difference(999, 0, 1000), 1);
  EXPECT_EQ(eqep_difference(0, 999, 1000), -1);
  EXPECT_EQ(eqep_difference(7, 7, 1000), 0);
}

TEST_F(EqepTest, SetsTheCeilingBeforeItStartsTheDecoder) {
  const std::string dir = addCounter("48302180", 1);
  ASSERT_EQ(eqep_open(&encoder_, "48302180"), 0);
  EXPECT_EQ(SyscallJournal::instance().lines(),
            (std::vector<std::string>{"count0/enable=0", "count0/function=quadrature x4",
                                      "count0/ceiling=4294967295", "count0/enable=1"}));
  EXPECT_EQ(attribute(dir, "count0/enable"), "1");
}

TEST_F(EqepTest, FindsItsDecoderByAddressNotNumber) {
  addCounter("48304180", 0);
  const std::string dir = addCounter("48300180", 1);
  ASSERT_EQ(eqep_open(&encoder_, "48300180"), 0);
  EXPECT_EQ(readAfter(dir, "count0/count", "12"), 12);
}

TEST_F(EqepTest, StartsAtZeroAndUnwrapsUnsignedCounts) {
  const std::string dir = addCounter("48300180", 0);
  setAttribute(dir, "count0/count", "4294967290");
  ASSERT_EQ(eqep_open(&encoder_, "48300180"), 0);
  EXPECT_EQ(readAfter(dir, "count0/count", "4294967290"), 0);
  EXPECT_EQ(readAfter(dir, "count0/count", "4"), 10);
  EXPECT_EQ(readAfter(dir, "count0/count", "4294967280"), -10);
  EXPECT_EQ(readAfter(dir, "count0/count", "4294967295"), 5);
}

TEST_F(EqepTest, UnwrapsBeyondThirtyTwoBits) {
  const std::string dir = addCounter("48300180", 0);
  ASSERT_EQ(eqep_open(&encoder_, "48300180"), 0);
  int64_t counts = 0;
  for (int turn = 0; turn < 6; ++turn) {
    for (const char* at : {"1500000000", "3000000000", "0"}) counts = readAfter(dir, "count0/count", at);
  }
  EXPECT_EQ(counts, 6 * static_cast<int64_t>(k32));
}

TEST_F(EqepTest, ReadsTheSignedPositionOfOldKernels) {
  const std::string dir = addLegacyEqep("48304180");
  ASSERT_EQ(eqep_open(&encoder_, "48304180"), 0);
  EXPECT_EQ(attribute(dir, "enabled"), "1");
  EXPECT_EQ(readAfter(dir, "position", "-3"), -3);
  EXPECT_EQ(readAfter(dir, "position", "-2147483648"), -2147483648LL);
  EXPECT_EQ(readAfter(dir, "position", "2147483647"), -2147483649LL) << "wrapped downwards";
}

TEST_F(EqepTest, OldKernelsWithoutModesWorkToo) {
  removeAttribute(addLegacyEqep("48304180"), "mode");
  EXPECT_EQ(eqep_open(&encoder_, "48304180"), 0);
}

TEST_F(EqepTest, MinusOneIsACountNotAnError) {
  const std::string dir = addLegacyEqep("48304180");
  ASSERT_EQ(eqep_open(&encoder_, "48304180"), 0);
  EXPECT_EQ(readAfter(dir, "position", "-1"), -1);
}

TEST_F(EqepTest, ReportsAMissingDeviceOrAttribute) {
  encoder_.fd = 77;
  EXPECT_EQ(eqep_open(&encoder_, "48300180"), -ENODEV);
  EXPECT_EQ(encoder_.fd, -1) << "whatever was there before";
  for (const char* name : {"count0/enable", "count0/ceiling", "count0/count", "count0/function"}) {
    const std::string dir = addCounter("48300180", 0);
    removeAttribute(dir, name);
    EXPECT_EQ(eqep_open(&encoder_, "48300180"), -ENOENT) << name;
    EXPECT_EQ(encoder_.fd, -1);
    removeDevice(dir);
    removeDevice("/sys/bus/counter/devices/counter0");
  }
}

TEST_F(EqepTest, ReportsRefusedSettings) {
  addCounter("48300180", 0);
  SyscallJournal::instance().failWrite("count0/enable", EACCES);
  EXPECT_EQ(eqep_open(&encoder_, "48300180"), -EACCES);
  SyscallJournal::instance().failWrite("count0/function", EINVAL);
  EXPECT_EQ(eqep_open(&encoder_, "48300180"), -EINVAL);
  SyscallJournal::instance().failWrite("count0/ceiling", EBUSY);
  EXPECT_EQ(eqep_open(&encoder_, "48300180"), -EBUSY);
}

TEST_F(EqepTest, ReportsUnplugAndGarbageAndCountsOnAfterwards) {
  const std::string dir = addCounter("48300180", 0);
  ASSERT_EQ(eqep_open(&encoder_, "48300180"), 0);
  ASSERT_EQ(readAfter(dir, "count0/count", "100"), 100);
  int64_t counts = 77;
  SyscallJournal::instance().failRead("count0/count", ENODEV);
  EXPECT_EQ(eqep_read(&encoder_, &counts), -ENODEV);
  SyscallJournal::instance().failRead("count0/count", 0);  // short read
  EXPECT_EQ(eqep_read(&encoder_, &counts), -EBADMSG);
  setAttribute(dir, "count0/count", "4294967296");
  EXPECT_EQ(eqep_read(&encoder_, &counts), -ERANGE);
  EXPECT_EQ(counts, 77) << "no count without a reading";
  EXPECT_EQ(readAfter(dir, "count0/count", "110"), 110);
}

TEST_F(EqepTest, TakesTheCeilingThatTheDecoderKept) {
  const std::string dir = addCounter("48300180", 0);
  SyscallJournal::instance().onWrite("count0/ceiling", [&] { setAttribute(dir, "count0/ceiling", "999"); });
  ASSERT_EQ(eqep_open(&encoder_, "48300180"), 0);
  EXPECT_EQ(readAfter(dir, "count0/count", "999"), -1);
  EXPECT_EQ(readAfter(dir, "count0/count", "3"), 3);
  EXPECT_EQ(readAfter(dir, "count0/count", "503"), 503) << "half a turn counts forwards";
  setAttribute(dir, "count0/count", "1000");
  int64_t counts = 0;
  EXPECT_EQ(eqep_read(&encoder_, &counts), -ERANGE);
}

TEST_F(EqepTest, ACeilingOfZeroIsNoCounter) {
  const std::string dir = addCounter("48300180", 0);
  const char* kept = "0";
  SyscallJournal::instance().onWrite("count0/ceiling", [&] { setAttribute(dir, "count0/ceiling", kept); });
  EXPECT_EQ(eqep_open(&encoder_, "48300180"), -ERANGE);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  kept = "1";
  EXPECT_EQ(eqep_open(&encoder_, "48300180"), 0);
}

TEST_F(EqepTest, ACountThatCannotBeReadAtFirstLeavesNothingOpen) {
  const std::string dir = addCounter("48300180", 0);
  setAttribute(dir, "count0/count", "none");
  EXPECT_EQ(eqep_open(&encoder_, "48300180"), -EBADMSG);
  EXPECT_EQ(encoder_.fd, -1);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}

TEST_F(EqepTest, OldKernelsReportRefusalsAndImpossiblePositionsToo) {
  const std::string dir = addLegacyEqep("48304180");
  SyscallJournal::instance().failWrite("/mode", EACCES);
  EXPECT_EQ(eqep_open(&encoder_, "48304180"), -EACCES);
  SyscallJournal::instance().failWrite("/enabled", EBUSY);
  EXPECT_EQ(eqep_open(&encoder_, "48304180"), -EBUSY);
  ASSERT_EQ(eqep_open(&encoder_, "48304180"), 0);
  EXPECT_EQ(attribute(dir, "mode"), "0") << "absolute position";
  setAttribute(dir, "position", "-4294967297");
  int64_t counts = 0;
  EXPECT_EQ(eqep_read(&encoder_, &counts), -ERANGE);
  eqep_close(&encoder_);
  removeAttribute(dir, "position");
  EXPECT_EQ(eqep_open(&encoder_, "48304180"), -ENOENT);
}

TEST_F(EqepTest, ThatWasNeverOpenedClosesNothing) {
  eqep_t zeroed{};
  ASSERT_EQ(zeroed.fd, 0) << "somebody's descriptor";
  eqep_close(&zeroed);
  EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
  EXPECT_EQ(zeroed.fd, -1);
}

TEST_F(EqepTest, DescriptorZeroIsOneLikeAnyOtherAndIsClosedOnce) {
  const std::string dir = addCounter("48300180", 0);
  {
    const NoStdin none;
    ASSERT_EQ(eqep_open(&encoder_, "48300180"), 0);
    EXPECT_EQ(encoder_.fd, 0);
    EXPECT_EQ(readAfter(dir, "count0/count", "3"), 3);
    eqep_close(&encoder_);
  }
  EXPECT_EQ(encoder_.fd, -1);
  eqep_close(&encoder_);
  addLegacyEqep("48304180");
  const NoStdin none;
  ASSERT_EQ(eqep_open(&encoder_, "48304180"), 0);
  EXPECT_EQ(encoder_.fd, 0);
  eqep_close(&encoder_);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
}
