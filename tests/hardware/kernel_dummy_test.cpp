// Scans of the IIO device that the kernel brings for such tests: iio_dummy, whose numbers are made up (344 of
// its accelerometer's x), on the trigger that a file pulls.
#include <errno.h>
#include <gtest/gtest.h>
#include <iio_imu.h>
#include <monotonic.h>
#include <sys/stat.h>
#include <sysfs.h>
#include <unistd.h>

#include <string>

namespace {
const std::string kDevices = "/sys/bus/iio/devices/";
constexpr int kItsAcceleration = 344;

/// One that is called so, for as long as it lives.
class KernelDummy : public ::testing::Test {
 protected:
  void make(const std::string& name) {
    directory_ = "/sys/kernel/config/iio/devices/dummy/" + name;
    ASSERT_EQ(mkdir(directory_.c_str(), 0755), 0) << directory_ << ": " << strerror(errno);
  }
  ~KernelDummy() override { rmdir(directory_.c_str()); }
  void pull() { ASSERT_EQ(sysfs_write_text(trigger_.c_str(), "trigger_now", "1"), 0); }
  void SetUp() override {
    char trigger[SYSFS_PATH_MAX];
    if (sysfs_find(kDevices.c_str(), "trigger", "sysfstrig7", trigger) != 0) {
      ASSERT_EQ(sysfs_write_text((kDevices + "iio_sysfs_trigger").c_str(), "add_trigger", "7"), 0);
    }
    ASSERT_EQ(sysfs_find(kDevices.c_str(), "trigger", "sysfstrig7", trigger), 0);
    trigger_ = trigger;
  }

  iio_fault_t fault_{};

 private:
  std::string directory_, trigger_;
};
}  // namespace

TEST_F(KernelDummy, ItsScansHaveItsNumbersAndTheTimeOfTheirTrigger) {
  make("bench");
  iio_device_t device;
  ASSERT_EQ(iio_open(&device, "bench", &fault_), 0) << fault_.where;
  device.channels = 2;
  snprintf(device.channel[0].name, sizeof device.channel[0].name, "in_accel_x");
  snprintf(device.channel[1].name, sizeof device.channel[1].name, "in_timestamp");
  ASSERT_EQ(iio_start(&device, "sysfstrig7", &fault_), 0) << fault_.where << ": " << fault_.advice;
  const uint8_t* scan = nullptr;
  EXPECT_EQ(iio_newest(&device, &scan), 0) << "not before it is triggered";
  for (int i = 0; i < 3; ++i) {
    const int64_t before_ns = monotonic_ns();
    pull();
    usleep(20'000);
    ASSERT_EQ(iio_newest(&device, &scan), 1);
    EXPECT_EQ(iio_value(&device.channel[0], scan), kItsAcceleration);
    EXPECT_GE(iio_value(&device.channel[1], scan), before_ns);
    EXPECT_LE(iio_value(&device.channel[1], scan), monotonic_ns());
  }
  for (int i = 0; i < 3; ++i) pull(), usleep(20'000);
  EXPECT_EQ(iio_newest(&device, &scan), 3) << "all that have come";
  iio_close(&device);
}

TEST_F(KernelDummy, WhatBearsAPartsNameAndIsNoImuIsRefusedByName) {
  make("mpu6500");
  iio_imu_config_t config{};
  while (imu_part(config.part)->name != std::string("mpu6500")) ++config.part;
  config.low_pass = 2;
  config.gyro_range_dps = 2000;
  config.accel_range_g = 8;
  config.stale_after_ns = 1'000'000'000;
  config.trigger = "sysfstrig7";
  iio_imu_t imu;
  EXPECT_LT(iio_imu_open(&imu, &config, &fault_), 0);
  EXPECT_NE(std::string(fault_.where).find("mpu6500"), std::string::npos) << fault_.where;
  EXPECT_NE(fault_.advice, nullptr);
  printf("refused: %s: %s\n", fault_.where, fault_.advice);
  iio_imu_close(&imu);
}
