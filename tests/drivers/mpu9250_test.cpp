#include "mpu9250.h"

#include <errno.h>

#include <initializer_list>

#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
constexpr mpu9250_config_t kConfig = {"/dev/i2c-2", 0x68, 200, 2000, 8, 2, 3, true};

class Mpu9250Test : public Testbed {
 protected:
  void SetUp() override { addImu(); }
  void TearDown() override { mpu9250_close(&chip_); }

  mpu9250_t chip_{};
  Mpu9250Test() { chip_.i2c.fd = -1; }
};
}  // namespace

TEST_F(Mpu9250Test, ConfiguresRangesRateFilterAndInterrupt) {
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  EXPECT_EQ(imu.reg(0x6B), 0x01);  // awake, best clock
  EXPECT_EQ(imu.reg(0x19), 4);     // 1000 / (1 + 4) = 200 Hz
  EXPECT_EQ(imu.reg(0x1A), 2);
  EXPECT_EQ(imu.reg(0x1B), 0x18);  // 2000 deg/s
  EXPECT_EQ(imu.reg(0x1C), 0x10);  // 8 g
  EXPECT_EQ(imu.reg(0x1D), 2);
  EXPECT_EQ(imu.reg(0x37), 0x80);  // active low pulse
  EXPECT_EQ(imu.reg(0x38), 0x01);
  EXPECT_EQ(imu.writes().front(), (std::array<uint8_t, 2>{0x6B, 0x80}));  // reset first
  EXPECT_FALSE(chip_.variant);
}

TEST_F(Mpu9250Test, TakesEveryRateAndRangeOfTheChipAndNoOther) {
  const auto opened = [&](auto&& change) {
    mpu9250_config_t config = kConfig;
    change(config);
    const int status = mpu9250_open(&chip_, &config);
    mpu9250_close(&chip_);
    return status;
  };
  for (const uint16_t rate : std::initializer_list<uint16_t>{4, 5, 500, 1000})
    EXPECT_EQ(opened([&](auto& c) { c.rate_hz = rate; }), 0) << rate;
  for (const uint16_t rate : std::initializer_list<uint16_t>{0, 2, 3, 1001, 2000})
    EXPECT_EQ(opened([&](auto& c) { c.rate_hz = rate; }), -EINVAL) << rate;
  for (const uint16_t range : std::initializer_list<uint16_t>{250, 500, 1000, 2000})
    EXPECT_EQ(opened([&](auto& c) { c.gyro_range_dps = range; }), 0) << range;
  for (const uint16_t range : std::initializer_list<uint16_t>{0, 125, 251, 4000})
    EXPECT_EQ(opened([&](auto& c) { c.gyro_range_dps = range; }), -EINVAL) << range;
  for (const uint8_t range : std::initializer_list<uint8_t>{2, 4, 8, 16})
    EXPECT_EQ(opened([&](auto& c) { c.accel_range_g = range; }), 0) << int{range};
  for (const uint8_t range : std::initializer_list<uint8_t>{0, 1, 3, 32})
    EXPECT_EQ(opened([&](auto& c) { c.accel_range_g = range; }), -EINVAL) << int{range};
  for (const uint8_t dlpf : std::initializer_list<uint8_t>{1, 6})
    EXPECT_EQ(opened([&](auto& c) { c.dlpf = dlpf; }), 0) << int{dlpf};
  for (const uint8_t dlpf : std::initializer_list<uint8_t>{0, 7})
    EXPECT_EQ(opened([&](auto& c) { c.dlpf = dlpf; }), -EINVAL) << int{dlpf};
}

TEST_F(Mpu9250Test, LeavesNoDescriptorOpenWhetherItOpensOrNot) {
  const SyscallJournal& journal = SyscallJournal::instance();
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  EXPECT_EQ(journal.openFiles(), 1);
  mpu9250_close(&chip_);
  EXPECT_EQ(journal.openFiles(), 0);
  imu.setWhoAmI(0x68);
  EXPECT_EQ(mpu9250_open(&chip_, &kConfig), -ENODEV);
  EXPECT_EQ(journal.openFiles(), 0);
  plain_i2c = false;
  EXPECT_EQ(mpu9250_open(&chip_, &kConfig), -EOPNOTSUPP);
  EXPECT_EQ(journal.openFiles(), 0);
  plain_i2c = true;
  imu.setWhoAmI(0x71);
  const NoStdin none;
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  EXPECT_EQ(chip_.i2c.fd, 0);
  mpu9250_close(&chip_);
  EXPECT_EQ(journal.strayCloses(), 0);
}

TEST_F(Mpu9250Test, TheFirstSampleIsNeverARepetition) {
  for (const int16_t value : {int16_t{0}, int16_t{0x0101}}) {
    ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
    imu.setSample({value, value, value}, {value, value, value});
    mpu9250_sample_t sample{};
    ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
    EXPECT_EQ(sample.flags & MPU9250_STUCK, 0) << value;
    mpu9250_close(&chip_);
  }
}

TEST_F(Mpu9250Test, AcceptsRelativesWithAWarningAndRefusesStrangers) {
  for (const uint8_t who : {uint8_t{0x73}, uint8_t{0x70}}) {
    imu.setWhoAmI(who);
    ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
    EXPECT_TRUE(chip_.variant);
    EXPECT_EQ(chip_.who_am_i, who);
    mpu9250_close(&chip_);
  }
  imu.setWhoAmI(0x68);  // MPU-6050: other registers
  EXPECT_EQ(mpu9250_open(&chip_, &kConfig), -ENODEV);
}

TEST_F(Mpu9250Test, ReadsBigEndianCountsInOneTransfer) {
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  imu.setSample({1, -2, 4096}, {-300, 0x1234, -32767});
  imu.setRegister(0x41, 0xFF);
  imu.setRegister(0x42, 0xFE);
  const int before = imu.transfers();
  mpu9250_sample_t sample;
  ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
  EXPECT_EQ(imu.transfers(), before + 1);
  EXPECT_EQ(sample.accel[0], 1);
  EXPECT_EQ(sample.accel[1], -2);
  EXPECT_EQ(sample.accel[2], 4096);
  EXPECT_EQ(sample.gyro[0], -300);
  EXPECT_EQ(sample.gyro[1], 0x1234);
  EXPECT_EQ(sample.gyro[2], -32767);
  EXPECT_EQ(sample.temperature, -2);
  EXPECT_EQ(sample.flags, 0u);
}

TEST_F(Mpu9250Test, FlagsAnAxisAtEitherEndOfItsRange) {
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  mpu9250_sample_t sample;
  imu.setSample({0, 0, 4096}, {0, 32767, 0});
  ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
  EXPECT_EQ(sample.flags, MPU9250_CLIPPED);
  imu.setSample({-32768, 0, 4096}, {0, 0, 0});
  ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
  EXPECT_EQ(sample.flags, MPU9250_CLIPPED);
  imu.setSample({-32767, 0, 32766}, {0, 0, 0});
  ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
  EXPECT_EQ(sample.flags, 0u);
}

TEST_F(Mpu9250Test, FlagsAStuckSensorAndForgivesItWhenItMoves) {
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  mpu9250_sample_t sample;
  imu.setSample({1, 2, 3}, {4, 5, 6});
  for (int i = 0; i < 3; ++i) {  // the first, and two repetitions
    ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
    EXPECT_EQ(sample.flags, 0u) << i;
    imu.setRegister(0x42, static_cast<uint8_t>(i));  // a drifting temperature does not hide it
  }
  ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
  EXPECT_EQ(sample.flags, MPU9250_STUCK);
  imu.setSample({1, 2, 3}, {4, 5, 7});
  ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
  EXPECT_EQ(sample.flags, 0u);
}

TEST_F(Mpu9250Test, RefusesImpossibleConfigurations) {
  const auto refused = [&](auto change) {
    mpu9250_config_t config = kConfig;
    change(config);
    return mpu9250_open(&chip_, &config) == -EINVAL && chip_.i2c.fd == -1;
  };
  EXPECT_TRUE(refused([](auto& c) { c.rate_hz = 300; }));
  EXPECT_TRUE(refused([](auto& c) { c.rate_hz = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.gyro_range_dps = 1999; }));
  EXPECT_TRUE(refused([](auto& c) { c.accel_range_g = 3; }));
  EXPECT_TRUE(refused([](auto& c) { c.dlpf = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.dlpf = 7; }));
}

TEST_F(Mpu9250Test, ReportsMissingBusAndAdapterWithoutPlainI2c) {
  mpu9250_config_t config = kConfig;
  config.bus = "/dev/i2c-9";
  chip_.i2c.fd = 77;
  EXPECT_EQ(mpu9250_open(&chip_, &config), -ENOENT);
  EXPECT_EQ(chip_.i2c.fd, -1) << "whatever was there before";
  plain_i2c = false;
  EXPECT_EQ(mpu9250_open(&chip_, &kConfig), -EOPNOTSUPP);
}

TEST_F(Mpu9250Test, ReportsAMissingAcknowledgeAtEveryStepOfOpening) {
  // who am I, two power writes, then write and read-back of seven registers
  for (int step = 0; step < 3 + 14; step += step < 4 ? 1 : 3) {
    imu.failNext(EREMOTEIO, 1, step);
    EXPECT_EQ(mpu9250_open(&chip_, &kConfig), -EREMOTEIO) << step;
    EXPECT_EQ(chip_.i2c.fd, -1);
  }
  mpu9250_config_t config = kConfig;
  config.address = 0x69;
  EXPECT_EQ(mpu9250_open(&chip_, &config), -ENXIO);
}

TEST_F(Mpu9250Test, ReportsARegisterThatDoesNotKeepItsValue) {
  for (const uint8_t reg : {uint8_t{0x19}, uint8_t{0x1B}, uint8_t{0x38}}) {
    imu.keepRegister(reg);
    EXPECT_EQ(mpu9250_open(&chip_, &kConfig), -EIO) << int{reg};
    EXPECT_EQ(chip_.i2c.fd, -1);
  }
}

// RM-MPU-9250A 4.4, 4.6, 4.7: SMPLRT_DIV, GYRO_FS_SEL and ACCEL_FS_SEL.
TEST_F(Mpu9250Test, WritesTheCodesOfRatesAndRanges) {
  for (uint8_t code = 0; code < 4; ++code) {
    mpu9250_config_t config = kConfig;
    config.rate_hz = static_cast<uint16_t>(1000 >> code);
    config.gyro_range_dps = static_cast<uint16_t>(250 << code);
    config.accel_range_g = static_cast<uint8_t>(2 << code);
    config.dlpf = static_cast<uint8_t>(code + 1);
    config.interrupt_active_low = false;
    ASSERT_EQ(mpu9250_open(&chip_, &config), 0);
    EXPECT_EQ(imu.reg(0x19), (1 << code) - 1);
    EXPECT_EQ(imu.reg(0x1B), code << 3);
    EXPECT_EQ(imu.reg(0x1C), code << 3);
    EXPECT_EQ(imu.reg(0x1A), code + 1);
    EXPECT_EQ(imu.reg(0x1D), code + 1);
    EXPECT_EQ(imu.reg(0x37), 0x00) << "active high";
    mpu9250_close(&chip_);
  }
}

TEST_F(Mpu9250Test, IsNeverStuckWhenNobodyAsks) {
  mpu9250_config_t config = kConfig;
  config.stuck_after = 0;
  ASSERT_EQ(mpu9250_open(&chip_, &config), 0);
  mpu9250_sample_t sample;
  for (int i = 0; i < 10; ++i) {
    ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
    EXPECT_EQ(sample.flags, 0u);
  }
}

TEST_F(Mpu9250Test, EveryAxisIsWatchedForStandingStill) {
  mpu9250_config_t config = kConfig;
  config.stuck_after = 1;
  ASSERT_EQ(mpu9250_open(&chip_, &config), 0);
  mpu9250_sample_t sample;
  ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
  for (size_t axis = 0; axis < 6; ++axis) {
    std::array<int16_t, 3> accel{}, gyro{};
    (axis < 3 ? accel : gyro)[axis % 3] = static_cast<int16_t>(axis % 2 == 0 ? 256 : 1);  // either byte
    imu.setSample(accel, gyro);
    ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
    EXPECT_EQ(sample.flags, 0u) << axis;
    ASSERT_EQ(mpu9250_read(&chip_, &sample), 0);
    EXPECT_EQ(sample.flags, MPU9250_STUCK) << axis;
  }
}

TEST_F(Mpu9250Test, ReportsBusErrorsWhileReadingAndRecovers) {
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  mpu9250_sample_t sample;
  imu.failNext(EREMOTEIO);
  EXPECT_EQ(mpu9250_read(&chip_, &sample), -EREMOTEIO);
  imu.shortNext();
  EXPECT_EQ(mpu9250_read(&chip_, &sample), -EIO);
  imu.failNext(ENODEV);
  EXPECT_EQ(mpu9250_read(&chip_, &sample), -ENODEV);
  EXPECT_EQ(mpu9250_read(&chip_, &sample), 0);
}

TEST_F(Mpu9250Test, ClosePutsTheChipToSleep) {
  ASSERT_EQ(mpu9250_open(&chip_, &kConfig), 0);
  imu.setRegister(0x6A, 0xC0);  // a DMP that runs
  mpu9250_close(&chip_);
  EXPECT_EQ(imu.reg(0x38), 0);
  EXPECT_EQ(imu.reg(0x6A), 0);
  EXPECT_EQ(imu.reg(0x6B), 0x40);
  mpu9250_close(&chip_);  // twice is once
}
