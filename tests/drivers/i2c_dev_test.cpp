#include "i2c_dev.h"

#include <errno.h>

#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
class I2cTest : public Testbed {
 protected:
  void SetUp() override { addImu(); }
  void TearDown() override { i2c_dev_close(&bus_); }
  i2c_dev_t bus_{-1, 0};
};
}  // namespace

TEST_F(I2cTest, WritesAsMuchAsItsBufferHolds) {
  ASSERT_EQ(i2c_dev_open(&bus_, "/dev/i2c-2", 0x68), 0);
  uint8_t bytes[I2C_DEV_MAX_WRITE + 1];
  for (size_t i = 0; i < sizeof bytes; ++i) bytes[i] = static_cast<uint8_t>(100 + i);
  ASSERT_EQ(i2c_dev_write(&bus_, 0x6F, bytes, I2C_DEV_MAX_WRITE), 0);  // the DMP's memory from 0 on
  EXPECT_EQ(imu.dmpMemory(0), 100);
  EXPECT_EQ(imu.dmpMemory(I2C_DEV_MAX_WRITE - 1), 99 + I2C_DEV_MAX_WRITE);
  EXPECT_EQ(imu.dmpMemory(I2C_DEV_MAX_WRITE), 0);
  const int before = imu.transfers();
  EXPECT_EQ(i2c_dev_write(&bus_, 0x6F, bytes, I2C_DEV_MAX_WRITE + 1), -EMSGSIZE);
  EXPECT_EQ(imu.transfers(), before);
}

TEST_F(I2cTest, ReadsOneTransferFromTheRegisterOn) {
  ASSERT_EQ(i2c_dev_open(&bus_, "/dev/i2c-2", 0x68), 0);
  ASSERT_EQ(i2c_dev_write_byte(&bus_, 0x19, 7), 0);
  ASSERT_EQ(i2c_dev_write_byte(&bus_, 0x1A, 8), 0);
  uint8_t two[3] = {0, 0, 0xAA};
  ASSERT_EQ(i2c_dev_read(&bus_, 0x19, two, 2), 0);
  EXPECT_EQ(two[0], 7);
  EXPECT_EQ(two[1], 8);
  EXPECT_EQ(two[2], 0xAA);
}

TEST_F(I2cTest, AShortTransferOfEitherDirectionIsAnError) {
  ASSERT_EQ(i2c_dev_open(&bus_, "/dev/i2c-2", 0x68), 0);
  uint8_t byte = 0;
  imu.shortNext();
  EXPECT_EQ(i2c_dev_read(&bus_, 0x75, &byte, 1), -EIO);
  imu.shortNext();
  EXPECT_EQ(i2c_dev_write_byte(&bus_, 0x19, 7), -EIO);
}

TEST_F(I2cTest, DescriptorZeroIsOneLikeAnyOtherAndIsClosedOnce) {
  const NoStdin none;
  ASSERT_EQ(i2c_dev_open(&bus_, "/dev/i2c-2", 0x68), 0);
  EXPECT_EQ(bus_.fd, 0);
  uint8_t who = 0;
  EXPECT_EQ(i2c_dev_read(&bus_, 0x75, &who, 1), 0);
  EXPECT_EQ(who, 0x71);
  i2c_dev_close(&bus_);
  EXPECT_EQ(bus_.fd, -1);
  i2c_dev_close(&bus_);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
}

TEST_F(I2cTest, WhatIsNoBusIsRefusedAndClosed) {
  EXPECT_EQ(i2c_dev_open(&bus_, "/dev/null", 0x68), -ENOTTY);
  EXPECT_EQ(bus_.fd, -1);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}
