// An IMU behind the kernel's own driver: its registers in the bench, inv_mpu6050 or st_lsm6dsx of Debian's
// kernel, our IIO driver.
#include <errno.h>
#include <gtest/gtest.h>
#include <iio_imu.h>
#include <monotonic.h>

#include "bench.hpp"

namespace {
constexpr std::int64_t kWait_ns = 2'000'000'000;

struct Part {
  const char* driver;
  const char* name;
  int low_pass;
  double accel_step, gyro_step;  // of the chip, in the boundary's counts
  std::int64_t time_step_ns;     // of its own clock; 0: the kernel's stamps
};

class KernelImu : public ::testing::TestWithParam<Part> {
 protected:
  KernelImu() { bench_.serveImu(GetParam().driver); }
  ~KernelImu() override {
    iio_imu_close(&imu_);
    bench_.serveImu("");
  }
  int open() {
    iio_imu_config_t config{};
    while (imu_part(config.part)->name != std::string(GetParam().name)) ++config.part;
    config.low_pass = GetParam().low_pass;
    config.gyro_range_dps = 2000;
    config.accel_range_g = 8;
    config.stale_after_ns = kWait_ns;
    config.trigger = "";
    const int status = iio_imu_open(&imu_, &config, &fault_);
    EXPECT_EQ(status, 0) << fault_.where << ": " << fault_.advice;
    return status;
  }
  int wait() { return iio_imu_wait(&imu_, monotonic_ns() + kWait_ns, &stamp_ns_); }

  Bench bench_;
  iio_imu_t imu_{};
  iio_fault_t fault_{};
  iio_imu_sample_t sample_{};
  std::int64_t stamp_ns_ = 0;
};

INSTANTIATE_TEST_SUITE_P(Parts, KernelImu,
                         ::testing::Values(Part{"mpu6500", "mpu6500", 2, 0.1, 0.1, 0},
                                           Part{"spi:mpu6500", "mpu6500", 2, 0.1, 0.1, 0},
                                           Part{"lsm6dso", "lsm6dso", 1, 1.0, 1.15, 25'000}),
                         [](const auto& part) {
                           const bool spi = part.param.driver != std::string(part.param.name);
                           return std::string(part.param.name) + (spi ? "_on_spi" : "");
                         });
}  // namespace

TEST_P(KernelImu, CountsAreTheChipsAtTheRangesAskedFor) {
  ASSERT_EQ(open(), 0);
  bench_.setImu({100, -200, 4096}, {300, -400, 32000});
  const std::int64_t before_ns = monotonic_ns();
  bench_.dataReady();
  ASSERT_EQ(wait(), 1);
  EXPECT_GE(stamp_ns_, before_ns - GetParam().time_step_ns);
  EXPECT_LE(stamp_ns_, monotonic_ns());
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  const double accel[] = {100, -200, 4096};
  const double gyro[] = {300, -400, 32000};
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sample_.accel_counts[i], accel[i], 0.001 * std::abs(accel[i]) + GetParam().accel_step) << i;
    EXPECT_NEAR(sample_.gyro_counts[i], gyro[i], 0.001 * std::abs(gyro[i]) + GetParam().gyro_step) << i;
  }
  EXPECT_EQ(iio_imu_read(&imu_, &sample_), -EAGAIN);
}

TEST_P(KernelImu, ABusThatFailsDeliversNothingAndComesBack) {
  ASSERT_EQ(open(), 0);
  bench_.dataReady();
  ASSERT_EQ(wait(), 1);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  bench_.fault("imu", EREMOTEIO, UINT32_MAX);
  bench_.dataReady();
  EXPECT_EQ(iio_imu_wait(&imu_, monotonic_ns() + 50'000'000, &stamp_ns_), 0);
  bench_.fault("imu", 0, 0);
  iio_imu_close(&imu_);
  ASSERT_EQ(open(), 0);
  bench_.dataReady();
  EXPECT_EQ(wait(), 1);
}

TEST_P(KernelImu, TheSamplesOfASecondAreAllThereAndTheirTimesRise) {
  ASSERT_EQ(open(), 0);
  Metronome metronome(bench_);
  std::int64_t last_ns = 0;
  int samples = 0;
  for (const std::int64_t end_ns = monotonic_ns() + 1'000'000'000; monotonic_ns() < end_ns;) {
    samples += wait();
    EXPECT_GT(stamp_ns_, last_ns);
    last_ns = stamp_ns_;
    ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  }
  EXPECT_NEAR(samples, 200, 10);
}

TEST(KernelMpu6500, ItsRegistersAreAsAskedFor) {
  Bench bench;
  bench.serveImu("mpu6500");
  iio_imu_t imu;
  iio_fault_t fault;
  const iio_imu_config_t config = {1, 2, 2000, 8, 0, kWait_ns, ""};
  ASSERT_EQ(iio_imu_open(&imu, &config, &fault), 0) << fault.where;
  EXPECT_EQ(bench.imuRegister(0x19), 4) << "200 Hz of 1 kHz";
  EXPECT_EQ(bench.imuRegister(0x1a) & 7, 2) << "92 Hz";
  EXPECT_EQ(bench.imuRegister(0x1b) & 0x18, 0x18) << "2000 deg/s";
  EXPECT_EQ(bench.imuRegister(0x1c) & 0x18, 0x10) << "8 g";
  iio_imu_close(&imu);
  bench.serveImu("");
}
