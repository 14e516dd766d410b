#include <errno.h>
#include <fcntl.h>
#include <sysfs.h>
#include <unistd.h>

#include "syscall_journal.hpp"
#include "testbed.hpp"

using SysfsTest = Testbed;

TEST_F(SysfsTest, FindsADeviceByAddressWhateverItsNumber) {
  addPwm("48300200", 0);
  addPwm("48304200", 3);
  char dir[SYSFS_PATH_MAX];
  ASSERT_EQ(sysfs_find("/sys/class/pwm", "pwmchip", "48304200", dir), 0);
  EXPECT_STREQ(dir, "/sys/class/pwm/pwmchip3");
  EXPECT_EQ(sysfs_find("/sys/class/pwm", "pwmchip", "48302200", dir), -ENODEV);
}

TEST_F(SysfsTest, DoesNotMistakeAPrefixForTheDevice) {
  addPwm("48304200", 0);
  char dir[SYSFS_PATH_MAX];
  EXPECT_EQ(sysfs_find("/sys/class/pwm", "pwmchip", "483042", dir), -ENODEV);
  EXPECT_EQ(sysfs_find("/sys/class/pwm", "pwmchip", "", dir), -ENODEV);
}

TEST_F(SysfsTest, FindsADeviceByNameWithAndWithoutSuffix) {
  addAdc("TI-am335x-adc.0.auto", 1);
  char dir[SYSFS_PATH_MAX];
  EXPECT_EQ(sysfs_find("/sys/bus/iio/devices", "iio:device", "TI-am335x-adc", dir), 0);
  EXPECT_EQ(sysfs_find("/sys/bus/iio/devices", "iio:device", "TI-am335x", dir), -ENODEV);
}

TEST_F(SysfsTest, MissingClassIsMissingDevice) {
  char dir[SYSFS_PATH_MAX];
  EXPECT_EQ(sysfs_find("/sys/bus/counter/devices", "counter", "48300180", dir), -ENODEV);
}

class SysfsNumberTest : public Testbed {
 protected:
  int read(const std::string& text, int64_t* out) {
    const int fd = open(writeFile("value", text).c_str(), O_RDONLY);
    const int status = sysfs_read_i64(fd, out);
    close(fd);
    return status;
  }
};

TEST_F(SysfsNumberTest, ReadsSignedNumbers) {
  int64_t value = 0;
  ASSERT_EQ(read("4294967295\n", &value), 0);
  EXPECT_EQ(value, 4294967295);
  ASSERT_EQ(read("-2147483648\n", &value), 0);
  EXPECT_EQ(value, -2147483648LL);
  ASSERT_EQ(read("0", &value), 0);
  EXPECT_EQ(value, 0);
}

TEST_F(SysfsNumberTest, RefusesWhatIsNoNumber) {
  int64_t value = 77;
  for (const char* text : {"", "\n", "-", "abc", "12abc", "1 2", "9999999999999999999999"}) {
    EXPECT_EQ(read(text, &value), -EBADMSG) << text;
  }
  EXPECT_EQ(value, 77);
}

TEST_F(SysfsNumberTest, WritesDecimalNumbers) {
  const std::string path = writeFile("out", "");
  const int fd = open(path.c_str(), O_RDWR);
  for (const uint64_t value : {uint64_t{0}, uint64_t{50000}, UINT64_MAX}) {
    ASSERT_EQ(ftruncate(fd, 0), 0);
    ASSERT_EQ(sysfs_write_u64(fd, value), 0);
    char text[32] = {};
    ASSERT_GT(pread(fd, text, sizeof text - 1, 0), 0);
    EXPECT_EQ(std::string(text), std::to_string(value) + "\n");
  }
  close(fd);
}

TEST_F(SysfsNumberTest, ShortWriteIsAnError) {
  const int fd = open(writeFile("out", "").c_str(), O_RDWR);
  SyscallJournal::instance().failWrite("/out", 0);
  EXPECT_EQ(sysfs_write_u64(fd, 5), -EIO);
  close(fd);
}
