// The assembled board with an IMU of the kernel's: ticks, health and errors are those of the other driver.
#include <errno.h>

#include <memory>

#include "board_fixture.hpp"
#include "fake_iio.hpp"
#include "monotonic.h"

namespace {
class BbbIioTest : public BoardFixture {
 protected:
  void SetUp() override {
    BoardFixture::SetUp();
    config_.imu.driver = BBB_IMU_IIO;
    config_.imu.part = 0;
    config_.imu.interrupt.used = false;
    config_.imu.late_after_us = 50000;  // this machine may be busy
    dir_ = addDevice("iio", "2-0068/iio:device1",
                     iio_attributes("mpu9250", {"in_accel", "in_anglvel"}, "be:s16/16>>0"));
    node_ = std::make_unique<FakeIio>(hostPath("/dev/iio:device1"));
  }

  void push(std::int64_t stamp_ns, std::int64_t gyro_x = 1000) {
    const auto big = [](std::int64_t value) { return FakeIio::Field{value, 2, true}; };
    node_->push({big(0), big(++noise_), big(4096), big(gyro_x), big(0), big(0), {stamp_ns, 8}});
  }

  rio_sensors_t tick() {
    EXPECT_EQ(rio_wait_tick(&io_, &now_ns_), 0);
    rio_sensors_t sample{};
    EXPECT_EQ(rio_read_sensors(&io_, &sample), 0);
    return sample;
  }

  std::string dir_;
  std::unique_ptr<FakeIio> node_;
  std::int64_t noise_ = 0, now_ns_ = 0;
};

TEST_F(BbbIioTest, AScanIsATickAndItsTimeTheSamples) {
  open();
  const std::int64_t stamp_ns = monotonic_ns();
  push(stamp_ns);
  const rio_sensors_t sample = tick();
  EXPECT_EQ(sample.valid, uint32_t{RIO_IMU | RIO_ENCODERS | RIO_BATTERY});
  EXPECT_EQ(sample.health, 0u);
  EXPECT_EQ(sample.t_ns, stamp_ns);
  EXPECT_NEAR(sample.gyro_counts[0], 1000.0, 1.0) << "16.4 counts per deg/s";
  EXPECT_NEAR(sample.accel_counts[2], 4096.0, 5.0) << "4096 counts per g";
  EXPECT_EQ(FakeGpio::instance().line("481ae000", 21).edge, -1) << "its interrupt is the kernel's";
}

TEST_F(BbbIioTest, WithoutScansTicksAreLateAndGoOn) {
  open();
  push(monotonic_ns());
  tick();
  const std::int64_t began_ns = monotonic_ns();
  for (int i = 0; i < 3; ++i) {
    const rio_sensors_t sample = tick();
    EXPECT_EQ(sample.valid & RIO_IMU, 0u);
    EXPECT_EQ(sample.health, uint32_t{RIO_IMU_LATE});
  }
  EXPECT_LT(monotonic_ns() - began_ns, 1'000'000'000);
  push(monotonic_ns());
  EXPECT_EQ(tick().health, 0u);
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.late_ticks, 3u);
}

TEST_F(BbbIioTest, ADeviceThatIsGoneIsABusErrorAtTheLoopsRate) {
  open();
  push(monotonic_ns());
  tick();
  node_->unplug();
  const std::int64_t began_ns = monotonic_ns();
  for (int i = 0; i < 3; ++i) {
    const rio_sensors_t sample = tick();
    EXPECT_EQ(sample.valid & RIO_IMU, 0u);
    EXPECT_EQ(sample.health, uint32_t{RIO_IMU_BUS_ERROR});
    EXPECT_NE(sample.valid & RIO_ENCODERS, 0u);
  }
  EXPECT_GE(monotonic_ns() - began_ns, 10'000'000) << "no spin";
}

TEST_F(BbbIioTest, MissedScansAreCountedClippedAndStuckAreFlagged) {
  config_.imu.stuck_after = 2;
  open();
  const std::int64_t now_ns = monotonic_ns();
  for (int i = 0; i < 3; ++i) push(now_ns + i - 10);
  tick();
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.missed_edges, 2u);
  push(monotonic_ns(), 32767);
  EXPECT_EQ(tick().health, uint32_t{RIO_IMU_CLIPPED});
  for (int i = 0; i < 2; ++i) {
    --noise_;
    push(monotonic_ns(), 32767);
    const rio_sensors_t sample = tick();
    EXPECT_EQ(sample.valid & RIO_IMU, i == 0 ? uint32_t{RIO_IMU} : 0u) << i;
  }
}

/// 500 Hz: the loop keeps its 5 ms, whenever the scans come.
TEST_F(BbbIioTest, AnotherRateThanTheLoopsLeavesTheLoopItsOwnPace) {
  config_.imu.dlpf = 1;
  open();
  EXPECT_EQ(attribute(dir_, "sampling_frequency"), "500");
  push(monotonic_ns());
  const std::int64_t first_ns = tick().t_ns;
  const std::int64_t early_ns = monotonic_ns();
  push(early_ns);
  push(early_ns + 1);
  const rio_sensors_t sample = tick();
  EXPECT_EQ(sample.health, 0u);
  EXPECT_GE(now_ns_, first_ns + 5'000'000) << "not at the scan";
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.missed_edges, 0u);
  EXPECT_EQ(status.late_ticks, 0u);
  EXPECT_EQ(tick().health, uint32_t{RIO_IMU_LATE});
}

TEST_F(BbbIioTest, AnErrorNamesDeviceFileValueAndRemedyAndLeavesNothingOpen) {
  setAttribute(dir_, "scan_elements/in_accel_x_type", "be:q3");
  bbb_error_t error{};
  EXPECT_EQ(bbb_open(&config_, &io_, &error), -EBADMSG);
  EXPECT_STREQ(error.text,
               "imu: mpu9250 scan_elements/in_accel_x_type \"be:q3\": Bad message (EBADMSG): "
               "is no format that can be read here");
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}
}  // namespace
