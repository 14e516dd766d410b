#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
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

TEST_F(SysfsTest, LooksAtEntriesWithThePrefixOnly) {
  addPwm("48304200", 0);
  char dir[SYSFS_PATH_MAX];
  EXPECT_EQ(sysfs_find("/sys/class/pwm", "pwmchip1", "48304200", dir), -ENODEV);
  EXPECT_EQ(sysfs_find("/sys/class/pwm", "", "48304200", dir), 0);
  EXPECT_STREQ(dir, "/sys/class/pwm/pwmchip0");
}

TEST_F(SysfsTest, AClassThatIsNoDirectoryIsAnError) {
  char dir[SYSFS_PATH_MAX];
  EXPECT_EQ(sysfs_find(writeFile("file", "").c_str(), "", "48300180", dir), -ENOTDIR);
}

/// umockdev's thread opens sockets and the like meanwhile.
static int open_files_and_folders() {
  int open = 0;
  for (int fd = 0; fd < 256; ++fd) {
    struct stat s {};
    open += fstat(fd, &s) == 0 && (S_ISREG(s.st_mode) || S_ISDIR(s.st_mode)) ? 1 : 0;
  }
  return open;
}

TEST_F(SysfsTest, SearchesLeaveNoDescriptorOpen) {
  addPwm("48304200", 0);
  char dir[SYSFS_PATH_MAX];
  const int before = open_files_and_folders();
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(sysfs_find("/sys/class/pwm", "pwmchip", "48304200", dir), 0);
    EXPECT_EQ(sysfs_find("/sys/class/pwm", "pwmchip", "48302200", dir), -ENODEV);
  }
  EXPECT_EQ(open_files_and_folders(), before);
}

TEST_F(SysfsTest, PathsHaveABound) {
  char out[SYSFS_PATH_MAX];
  const std::string dir(SYSFS_PATH_MAX - 3, 'd');  // with a slash, one letter and the NUL
  EXPECT_EQ(sysfs_join(out, dir.c_str(), "x"), 0);
  EXPECT_EQ(std::string(out), dir + "/x");
  EXPECT_EQ(sysfs_join(out, dir.c_str(), "xy"), -ENAMETOOLONG);
  int64_t number = 0;
  char text[8];
  EXPECT_EQ(sysfs_open(dir.c_str(), "xy", O_RDONLY), -ENAMETOOLONG);
  EXPECT_EQ(sysfs_read_number(dir.c_str(), "xy", &number), -ENAMETOOLONG);
  EXPECT_EQ(sysfs_read_text(dir.c_str(), "xy", text, sizeof text), -ENAMETOOLONG);
  EXPECT_EQ(sysfs_write_number(dir.c_str(), "xy", 1), -ENAMETOOLONG);
  EXPECT_EQ(sysfs_write_text(dir.c_str(), "xy", "1"), -ENAMETOOLONG);
}

TEST_F(SysfsTest, TextIsOneLineAndFitsItsPlace) {
  const std::string path = writeFile("text", "quadrature x4\nmore\n");
  const std::string dir = path.substr(0, path.rfind('/'));
  char text[32];
  EXPECT_EQ(sysfs_read_text(dir.c_str(), "text", text, sizeof text), 0);
  EXPECT_STREQ(text, "quadrature x4");
  char small[5] = {'.', '.', '.', '.', '.'};
  EXPECT_EQ(sysfs_read_text(dir.c_str(), "text", small, 4), 0);
  EXPECT_STREQ(small, "qua");
  EXPECT_EQ(small[4], '.') << "nothing beyond";
  SyscallJournal::instance().failRead("/text", EIO);
  EXPECT_EQ(sysfs_read_text(dir.c_str(), "text", text, sizeof text), -EIO);
  SyscallJournal::instance().failWrite("/text", EINVAL);
  EXPECT_EQ(sysfs_write_text(dir.c_str(), "text", "increase"), -EINVAL);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}

TEST_F(SysfsTest, DescriptorZeroIsOneLikeAnyOther) {
  const std::string path = writeFile("number", "7\n");
  const std::string dir = path.substr(0, path.rfind('/'));
  const NoStdin none;
  int64_t number = 0;
  EXPECT_EQ(sysfs_read_number(dir.c_str(), "number", &number), 0);
  EXPECT_EQ(number, 7);
  char text[8];
  EXPECT_EQ(sysfs_read_text(dir.c_str(), "number", text, sizeof text), 0);
  EXPECT_EQ(sysfs_write_text(dir.c_str(), "number", "8\n"), 0);
  EXPECT_EQ(sysfs_write_number(dir.c_str(), "number", 9), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
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
  ASSERT_EQ(read("9223372036854775807\n", &value), 0);
  EXPECT_EQ(value, INT64_MAX);
  ASSERT_EQ(read("8", &value), 0);
  EXPECT_EQ(value, 8);
  ASSERT_EQ(read("9", &value), 0);
  EXPECT_EQ(value, 9);
  ASSERT_EQ(read("0", &value), 0);
  EXPECT_EQ(value, 0);
}

TEST_F(SysfsNumberTest, RefusesWhatIsNoNumber) {
  int64_t value = 77;
  for (const char* text : {"", "\n", "-", "abc", "12abc", "1 2", "1/", "1:", "/1", ":1",
                           "9223372036854775808", "9999999999999999999999"}) {
    EXPECT_EQ(read(text, &value), -EBADMSG) << text;
  }
  EXPECT_EQ(value, 77);
}

TEST_F(SysfsNumberTest, WritesDecimalNumbers) {
  const std::string path = writeFile("out", "");
  const int fd = open(path.c_str(), O_RDWR);
  for (const uint32_t value : {0u, 50000u, UINT32_MAX}) {
    ASSERT_EQ(ftruncate(fd, 0), 0);
    ASSERT_EQ(sysfs_write_u32(fd, value), 0);
    char text[32] = {};
    ASSERT_GT(pread(fd, text, sizeof text - 1, 0), 0);
    EXPECT_EQ(std::string(text), std::to_string(value) + "\n");
  }
  close(fd);
}

TEST_F(SysfsNumberTest, ShortWriteIsAnError) {
  const int fd = open(writeFile("out", "").c_str(), O_RDWR);
  SyscallJournal::instance().failWrite("/out", 0);
  EXPECT_EQ(sysfs_write_u32(fd, 5), -EIO);
  close(fd);
}
