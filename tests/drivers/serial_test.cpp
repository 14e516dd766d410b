// Against a real pseudo terminal: the kernel's line discipline is what the settings are about.
#include "serial.h"

#include <errno.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <string>

#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
class SerialTest : public ::testing::Test {
 protected:
  void SetUp() override {
    master_ = posix_openpt(O_RDWR | O_NOCTTY);
    ASSERT_GE(master_, 0);
    ASSERT_EQ(grantpt(master_), 0);
    ASSERT_EQ(unlockpt(master_), 0);
    path_ = ptsname(master_);
  }
  void TearDown() override {
    serial_close(&serial_);
    if (master_ >= 0) close(master_);
  }
  int master_ = -1;
  std::string path_;
  serial_t serial_{-1};
};
}  // namespace

TEST_F(SerialTest, Is8N1RawAtTheRateAskedFor) {
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 9600), 0);
  termios settings;
  ASSERT_EQ(tcgetattr(serial_.fd, &settings), 0);
  EXPECT_EQ(cfgetispeed(&settings), speed_t{B9600});
  EXPECT_EQ(cfgetospeed(&settings), speed_t{B9600});
  EXPECT_EQ(settings.c_cflag & (CSIZE | PARENB | CSTOPB | CRTSCTS), tcflag_t{CS8});
  EXPECT_EQ(settings.c_lflag & (ICANON | ECHO | ISIG), 0u);
}

TEST_F(SerialTest, PassesEveryByteUnchangedBothWays) {
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 115200), 0);
  uint8_t all[256];
  for (int i = 0; i < 256; ++i) all[i] = static_cast<uint8_t>(i);
  ASSERT_EQ(write(master_, all, sizeof all), ssize_t{256});
  std::string got;
  uint8_t chunk[64];
  for (int n; (n = serial_read(&serial_, chunk, sizeof chunk)) > 0;) got.append(chunk, chunk + n);
  EXPECT_EQ(got, std::string(all, all + 256));
  ASSERT_EQ(serial_write(&serial_, all, sizeof all), 256);
  uint8_t back[256];
  ASSERT_EQ(read(master_, back, sizeof back), ssize_t{256});
  EXPECT_EQ(std::string(back, back + 256), std::string(all, all + 256));
}

TEST_F(SerialTest, DescriptorZeroIsOneLikeAnyOther) {
  SyscallJournal::instance().clear();
  const NoStdin none;
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 9600), 0);
  EXPECT_EQ(serial_.fd, 0);
  EXPECT_EQ(serial_write(&serial_, reinterpret_cast<const uint8_t*>("x"), 1), 1);
  serial_close(&serial_);
  EXPECT_EQ(serial_.fd, -1);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
}

TEST_F(SerialTest, KnowsEveryRateThatItOffers) {
  const std::pair<uint32_t, speed_t> rates[] = {{1200, B1200},   {2400, B2400},    {4800, B4800},
                                                {9600, B9600},   {19200, B19200},  {38400, B38400},
                                                {57600, B57600}, {115200, B115200}};
  for (const auto& [baud, speed] : rates) {
    ASSERT_EQ(serial_open(&serial_, path_.c_str(), baud), 0) << baud;
    termios settings;
    ASSERT_EQ(tcgetattr(serial_.fd, &settings), 0);
    EXPECT_EQ(cfgetispeed(&settings), speed) << baud;
    EXPECT_EQ(settings.c_cc[VMIN], 1);
    EXPECT_EQ(settings.c_cc[VTIME], 0);
    serial_close(&serial_);
  }
}

TEST_F(SerialTest, NothingThereIsNotTheEnd) {
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 9600), 0);
  uint8_t byte;
  EXPECT_EQ(serial_read(&serial_, &byte, 1), -EAGAIN);
  close(master_);
  master_ = -1;
  EXPECT_EQ(serial_read(&serial_, &byte, 1), -EIO);
  EXPECT_EQ(serial_write(&serial_, &byte, 1), -EIO);
}

TEST_F(SerialTest, ReportsBadRateMissingDeviceAndNoTerminal) {
  serial_.fd = 77;
  EXPECT_EQ(serial_open(&serial_, path_.c_str(), 9601), -EINVAL);
  EXPECT_EQ(serial_.fd, -1) << "whatever was there before";
  EXPECT_EQ(serial_open(&serial_, "/dev/nonexistent", 9600), -ENOENT);
  EXPECT_EQ(serial_open(&serial_, "/dev/null", 9600), -ENOTTY);
  EXPECT_EQ(serial_.fd, -1);
}

TEST_F(SerialTest, ForgetsWhatCameBeforeItWasOpened) {
  const int early = open(path_.c_str(), O_RDWR | O_NOCTTY);
  ASSERT_EQ(write(master_, "stale\n", 6), ssize_t{6});
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 9600), 0);
  uint8_t byte;
  EXPECT_EQ(serial_read(&serial_, &byte, 1), -EAGAIN);
  close(early);
}

TEST_F(SerialTest, NeedsNoCarrierAndReceives) {
  const int before = open(path_.c_str(), O_RDWR | O_NOCTTY);
  termios settings;
  ASSERT_EQ(tcgetattr(before, &settings), 0);
  settings.c_cflag &= ~static_cast<tcflag_t>(CLOCAL | CREAD);
  settings.c_cflag |= CSTOPB | CRTSCTS | PARENB;
  ASSERT_EQ(tcsetattr(before, TCSANOW, &settings), 0);
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 9600), 0);
  ASSERT_EQ(tcgetattr(serial_.fd, &settings), 0);
  EXPECT_EQ(settings.c_cflag & (CLOCAL | CREAD), tcflag_t{CLOCAL | CREAD});
  EXPECT_EQ(settings.c_cflag & (CSTOPB | CRTSCTS | PARENB), 0u);
  close(before);
}

TEST_F(SerialTest, AReadOfNothingIsNoEnd) {
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 9600), 0);
  uint8_t byte;
  EXPECT_EQ(serial_read(&serial_, &byte, 0), 0);
}

TEST_F(SerialTest, IsClosedOnceAndAlsoWhenItIsNoTerminal) {
  SyscallJournal& journal = SyscallJournal::instance();
  journal.clear();
  EXPECT_EQ(serial_open(&serial_, "/dev/null", 9600), -ENOTTY);
  EXPECT_EQ(serial_.fd, -1);
  EXPECT_EQ(journal.openFiles(), 0);
  ASSERT_EQ(serial_open(&serial_, path_.c_str(), 9600), 0);
  EXPECT_EQ(journal.openFiles(), 1);
  EXPECT_EQ(journal.inheritable(), 0);
  serial_close(&serial_);
  serial_close(&serial_);
  EXPECT_EQ(journal.openFiles(), 0);
  EXPECT_EQ(journal.strayCloses(), 0);
}

TEST_F(SerialTest, PathsHaveABound) {
  const std::string longest = "/" + std::string(254, 'x');  // 256 with the NUL
  EXPECT_EQ(serial_open(&serial_, longest.c_str(), 9600), -ENOENT);
  EXPECT_EQ(serial_open(&serial_, (longest + "x").c_str(), 9600), -ENAMETOOLONG);
}

using SerialByAddress = Testbed;

TEST_F(SerialByAddress, IsThePortThatTheKernelHasThereWhateverItsName) {
  serial_t serial{-1};
  EXPECT_EQ(serial_open(&serial, "48022000", 9600), -ENODEV);
  addTty("481aa000", "ttyO5");
  addTty("48022000", "ttyO1");
  EXPECT_EQ(serial_open(&serial, "48022000", 9600), -ENOENT);  // found; /dev/ttyO1 itself is not made up
  EXPECT_EQ(serial_open(&serial, "48024000", 9600), -ENODEV);
}
