// An IMU behind the kernel's IIO: which files, which bytes, and what is said of a device that is not as it
// should be.
#include "iio_imu.h"

#include <errno.h>
#include <gmock/gmock.h>

#include <memory>

#include "fake_iio.hpp"
#include "monotonic.h"
#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kMpu9250 = 0, kLsm6dso = 3;
constexpr double kGyroScale = 0.001064724, kAccelScale = 0.002392;  // of +-2000 deg/s and +-8 g
constexpr double kGyroCounts = kGyroScale * 16.4 * 180.0 / 3.14159265358979323846,
                 kAccelCounts = kAccelScale * 4096.0 / 9.80665;

class IioImuTest : public Testbed {
 protected:
  void TearDown() override { iio_imu_close(&imu_); }

  /// The MPU-9250 of the kernel's driver: one device, big-endian, with a trigger of its own.
  void addMpu(const std::string& type = "be:s16/16>>0") {
    auto attributes = iio_attributes("mpu9250", {"in_accel", "in_anglvel"}, type);
    attributes["trigger/current_trigger"] = "mpu9250-dev3";
    attributes["in_accel_mount_matrix"] = attributes["in_anglvel_mount_matrix"] = "1, 0, 0; 0, 1, 0; 0, 0, 1";
    dir_ = addDevice("iio", "4819c000.i2c/i2c-2/2-0068/iio:device3", attributes);
    node_ = std::make_unique<FakeIio>(hostPath("/dev/iio:device3"));
  }

  int open(int part = kMpu9250, int low_pass = 2) {
    iio_imu_config_t config{};
    config.part = part;
    config.low_pass = low_pass;
    config.gyro_range_dps = 2000;
    config.accel_range_g = 8;
    config.stuck_after = 3;
    config.stale_after_ns = 100'000'000;
    config.trigger = trigger_.c_str();
    return iio_imu_open(&imu_, &config, &fault_);
  }

  /// The scan of addMpu: accelerometer, gyro, time.
  void push(std::int64_t stamp_ns, std::int64_t accel_x, std::int64_t gyro_z) {
    const auto big = [](std::int64_t value) { return FakeIio::Field{value, 2, true}; };
    node_->push({big(accel_x), big(-2), big(3), big(4), big(-5), big(gyro_z), {stamp_ns, 8}});
  }

  int wait(std::int64_t for_ms = 20) {
    return iio_imu_wait(&imu_, monotonic_ns() + for_ms * 1'000'000, &stamp_ns_);
  }

  /// Opening fails with `code`, says all of `words`, and leaves nothing open.
  void expectRefusal(int code, const std::vector<std::string>& words, int part = kMpu9250) {
    const int before = SyscallJournal::instance().openFiles();
    EXPECT_EQ(open(part, part == kMpu9250 ? 2 : 1), code);
    const std::string said =
        std::string(fault_.where) + ": " + (fault_.advice == nullptr ? "" : fault_.advice);
    for (const std::string& word : words) EXPECT_THAT(said, HasSubstr(word));
    EXPECT_NE(fault_.advice, nullptr) << "what to do";
    EXPECT_EQ(SyscallJournal::instance().openFiles(), before);
    EXPECT_EQ(imu_.devices, 0);
  }

  iio_imu_t imu_{};
  iio_fault_t fault_{};
  iio_imu_sample_t sample_{};
  std::unique_ptr<FakeIio> node_;
  std::string dir_, trigger_;
  std::int64_t stamp_ns_ = 0;
};

TEST_F(IioImuTest, SetsRateRangeClockAndBuffer) {
  addMpu();
  setAttribute(dir_, "scan_elements/in_magn_x_en", "1");  // of an earlier user
  ASSERT_EQ(open(), 0) << fault_.where;
  EXPECT_EQ(attribute(dir_, "sampling_frequency"), "200");
  EXPECT_EQ(attribute(dir_, "in_anglvel_scale"), "0.001064724");
  EXPECT_EQ(attribute(dir_, "in_accel_scale"), "0.002392");
  EXPECT_EQ(attribute(dir_, "current_timestamp_clock"), "monotonic");
  EXPECT_EQ(attribute(dir_, "scan_elements/in_anglvel_z_en"), "1");
  EXPECT_EQ(attribute(dir_, "scan_elements/in_timestamp_en"), "1");
  EXPECT_EQ(attribute(dir_, "scan_elements/in_magn_x_en"), "0");
  EXPECT_EQ(attribute(dir_, "buffer/watermark"), "1");
  EXPECT_EQ(attribute(dir_, "buffer/enable"), "1");
  iio_imu_close(&imu_);
  EXPECT_EQ(attribute(dir_, "buffer/enable"), "0");
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}

TEST_F(IioImuTest, DeliversTheBoundarysCountsAndTheScansTime) {
  addMpu();
  ASSERT_EQ(open(), 0) << fault_.where;
  const std::int64_t now_ns = monotonic_ns();
  push(now_ns - 1000, -1000, 700);
  ASSERT_EQ(wait(), 1);
  EXPECT_EQ(stamp_ns_, now_ns - 1000);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  EXPECT_NEAR(sample_.accel_counts[0], -1000 * kAccelCounts, 1e-9);
  EXPECT_NEAR(sample_.accel_counts[1], -2 * kAccelCounts, 1e-9);
  EXPECT_NEAR(sample_.gyro_counts[1], -5 * kGyroCounts, 1e-9);
  EXPECT_NEAR(sample_.gyro_counts[2], 700 * kGyroCounts, 1e-9);
  EXPECT_NEAR(kAccelCounts, 1.0, 2e-3) << "+-8 g is the boundary's scale";
  EXPECT_FALSE(sample_.clipped || sample_.stuck);
  EXPECT_EQ(iio_imu_read(&imu_, &sample_), -EAGAIN) << "never the same scan twice";
}

TEST_F(IioImuTest, TakesTheNewestOfSeveralAndSaysHowMany) {
  addMpu();
  ASSERT_EQ(open(), 0);
  const std::int64_t now_ns = monotonic_ns();
  for (int i = 0; i < 5; ++i) push(now_ns + i - 10, i, 0);
  ASSERT_EQ(wait(), 5);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  EXPECT_NEAR(sample_.accel_counts[0], 4 * kAccelCounts, 1e-9);
}

TEST_F(IioImuTest, DrainsALongerBacklogThanTheQueue) {
  addMpu();
  ASSERT_EQ(open(), 0);
  const std::int64_t now_ns = monotonic_ns();
  for (int i = 0; i < 100; ++i) push(now_ns + i - 1000, i, 0);
  ASSERT_EQ(wait(), 100);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  EXPECT_NEAR(sample_.accel_counts[0], 99 * kAccelCounts, 1e-9);
}

TEST_F(IioImuTest, AStaleOrRepeatedScanIsNone) {
  addMpu();
  ASSERT_EQ(open(), 0);
  const std::int64_t now_ns = monotonic_ns();
  push(now_ns - 200'000'000, 1, 0);
  EXPECT_EQ(wait(), 0) << "older than a tick and its grace";
  push(now_ns, 2, 0);
  EXPECT_EQ(wait(), 1);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  push(now_ns, 2, 0);
  EXPECT_EQ(wait(), 0) << "the same once more";
}

TEST_F(IioImuTest, WaitsNoLongerThanItsDeadline) {
  addMpu();
  ASSERT_EQ(open(), 0);
  const std::int64_t began_ns = monotonic_ns();
  EXPECT_EQ(wait(10), 0);
  EXPECT_GE(monotonic_ns() - began_ns, 10'000'000);
  EXPECT_EQ(iio_imu_wait(&imu_, 0, &stamp_ns_), 0) << "a deadline of the past";
}

TEST_F(IioImuTest, ReadsTheFormatThatTheDeviceDeclares) {
  struct Format {
    std::string type;
    std::size_t bytes;
    bool big_endian;
    std::int64_t stored, value;
  };
  const std::vector<Format> formats = {
      {"le:s16/16>>0", 2, false, -1234, -1234},    {"le:s12/16>>4", 2, false, -5 * 16 + 7, -5},
      {"be:s14/16>>2", 2, true, 100 * 4 + 3, 100}, {"be:s24/32>>8", 4, true, -70000 * 256, -70000},
      {"le:s20/32>>0", 4, false, 0xFFFFF, -1},     {"le:s8/8>>0", 1, false, -7, -7},
  };
  int number = 10;
  for (const Format& format : formats) {
    SCOPED_TRACE(format.type);
    const std::string id = std::to_string(number++);
    const std::string dir = addDevice("iio", "format" + id + "/iio:device" + id,
                                      iio_attributes("mpu9250", {"in_anglvel", "in_accel"}, format.type));
    FakeIio node(hostPath("/dev/iio:device" + id));
    ASSERT_EQ(open(), 0) << fault_.where;
    const FakeIio::Field field{format.stored, format.bytes, format.big_endian};
    node.push({field, field, field, field, field, field, {monotonic_ns(), 8}});
    ASSERT_EQ(wait(), 1);
    ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
    EXPECT_NEAR(sample_.gyro_counts[2], static_cast<double>(format.value) * kGyroCounts, 1e-6);
    iio_imu_close(&imu_);
    removeDevice(dir);
    removeDevice("/sys/bus/iio/devices/iio:device" + id);
  }
}

TEST_F(IioImuTest, TurnsSamplesByTheMountMatrix) {
  addMpu();
  setAttribute(dir_, "in_anglvel_mount_matrix", "0, -1, 0; 1, 0, 0; 0, 0, 1");
  ASSERT_EQ(open(), 0) << fault_.where;
  push(monotonic_ns(), 1, 6);  // gyro 4, -5, 6
  ASSERT_EQ(wait(), 1);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  EXPECT_NEAR(sample_.gyro_counts[0], 5 * kGyroCounts, 1e-9);
  EXPECT_NEAR(sample_.gyro_counts[1], 4 * kGyroCounts, 1e-9);
  EXPECT_NEAR(sample_.accel_counts[0], 1 * kAccelCounts, 1e-9) << "each kind has its own";
}

TEST_F(IioImuTest, TellsTheChipsTemperatureWhereItIsInTheScan) {
  auto attributes = iio_attributes("mpu9250", {"in_accel", "in_anglvel"}, "be:s16/16>>0");
  attributes["scan_elements/in_temp_en"] = "0";
  attributes["scan_elements/in_temp_type"] = "be:s16/16>>0";
  attributes["scan_elements/in_temp_index"] = "100";
  attributes["in_temp_scale"] = "2.995178";
  attributes["in_temp_offset"] = "7011";
  dir_ = addDevice("iio", "a/iio:device3", attributes);
  node_ = std::make_unique<FakeIio>(hostPath("/dev/iio:device3"));
  ASSERT_EQ(open(), 0) << fault_.where;
  EXPECT_EQ(attribute(dir_, "scan_elements/in_temp_en"), "1");
  const FakeIio::Field zero{0, 2, true};
  node_->push({zero, zero, zero, zero, zero, zero, {monotonic_ns(), 8}, {3339, 2, true}});
  ASSERT_EQ(wait(), 1);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  EXPECT_NEAR(sample_.temperature_degC, 31.0, 0.01);
}

TEST_F(IioImuTest, FlagsClippedAndStuckAsTheOtherDriver) {
  addMpu();
  ASSERT_EQ(open(), 0);
  std::int64_t now_ns = monotonic_ns() - 1000;
  const auto next = [&](std::int64_t accel, std::int64_t gyro) {
    push(++now_ns, accel, gyro);
    EXPECT_EQ(wait(), 1);
    EXPECT_EQ(iio_imu_read(&imu_, &sample_), 0);
    return sample_;
  };
  EXPECT_TRUE(next(32767, 0).clipped);
  EXPECT_TRUE(next(0, -32768).clipped);
  EXPECT_FALSE(next(32766, -32767).clipped);
  EXPECT_FALSE(next(32766, -32767).stuck);
  EXPECT_FALSE(next(32766, -32767).stuck);
  EXPECT_TRUE(next(32766, -32767).stuck);
  EXPECT_FALSE(next(32766, -32766).stuck);
}

TEST_F(IioImuTest, AScanInPartIsABusErrorAndTheNextIsRead) {
  addMpu();
  ASSERT_EQ(open(), 0);
  node_->pushBytes(std::vector<unsigned char>(10, 1));
  EXPECT_EQ(wait(), -EBADMSG);
  EXPECT_EQ(iio_imu_read(&imu_, &sample_), -EAGAIN);
  push(monotonic_ns(), 1, 0);
  EXPECT_EQ(wait(), 1);
}

TEST_F(IioImuTest, AnUnpluggedDeviceIsGone) {
  addMpu();
  ASSERT_EQ(open(), 0);
  SyscallJournal::instance().failRead("iio:device3", ENODEV);
  EXPECT_EQ(wait(), -ENODEV);
  push(monotonic_ns(), 1, 0);
  EXPECT_EQ(wait(), 1);
  node_->unplug();
  EXPECT_EQ(wait(), -ENODEV);
}

TEST_F(IioImuTest, TwoDevicesAreOneImu) {
  const std::string accel_dir =
      addDevice("iio", "2-006a/iio:device5", iio_attributes("lsm6dso_accel", {"in_accel"}, "le:s16/16>>0"));
  const std::string gyro_dir =
      addDevice("iio", "2-006a/iio:device4", iio_attributes("lsm6dso_gyro", {"in_anglvel"}, "le:s16/16>>0"));
  setAttribute(gyro_dir, "in_anglvel_scale_available", "0.000152716 0.000305432 0.000610865 0.001221730");
  FakeIio gyro(hostPath("/dev/iio:device4")), accel(hostPath("/dev/iio:device5"));
  ASSERT_EQ(open(kLsm6dso, 1), 0) << fault_.where;
  EXPECT_EQ(attribute(gyro_dir, "sampling_frequency"), "416");
  EXPECT_EQ(attribute(accel_dir, "sampling_frequency"), "416");
  EXPECT_EQ(attribute(gyro_dir, "in_anglvel_scale"), "0.001221730") << "2000 deg/s of this part";
  const std::int64_t now_ns = monotonic_ns();
  gyro.push({{1}, {2}, {-3}, {now_ns, 8}});
  EXPECT_EQ(wait(), 0) << "without the accelerometer";
  accel.push({{10}, {20}, {30}, {now_ns, 8}});
  gyro.push({{4}, {5}, {-6}, {now_ns + 1, 8}});
  ASSERT_GT(wait(), 0);
  EXPECT_EQ(stamp_ns_, now_ns + 1);
  ASSERT_EQ(iio_imu_read(&imu_, &sample_), 0);
  EXPECT_NEAR(sample_.accel_counts[2], 30 * kAccelCounts, 1e-9);
  EXPECT_NEAR(sample_.gyro_counts[2], -6 * kGyroCounts * 0.001221730 / kGyroScale, 1e-6);
}

TEST_F(IioImuTest, SaysWhichFileWhichValueAndWhatToDo) {
  expectRefusal(-ENODEV, {"mpu9250", "device tree", "cat /sys/bus/iio/devices/*/name"});
  addMpu();
  const auto with = [&](const std::string& file, const std::string& value, int code,
                        const std::vector<std::string>& words) {
    SCOPED_TRACE(file + " = " + value);
    const std::string before = attribute(dir_, file);
    if (value == "-") {
      removeAttribute(dir_, file);
    } else {
      setAttribute(dir_, file, value);
    }
    expectRefusal(code, words);
    setAttribute(dir_, file, before);
    for (const char* written : {"sampling_frequency", "in_accel_scale", "in_anglvel_scale",
                                "current_timestamp_clock", "buffer/length", "buffer/watermark"})
      setAttribute(dir_, written, "");
    setAttribute(dir_, "buffer/enable", "0");
  };
  with("scan_elements/in_accel_y_type", "be:x12/16>>4", -EBADMSG,
       {"mpu9250", "in_accel_y_type", "\"be:x12/16>>4\""});
  with("scan_elements/in_accel_y_type", "be:u16/16>>0", -EBADMSG, {"in_accel_y_type", "be:u16/16>>0"});
  with("scan_elements/in_accel_y_type", "be:s16/16>>4", -EBADMSG, {"in_accel_y_type"});
  with("scan_elements/in_accel_y_type", "be:s16/24>>0", -EBADMSG, {"in_accel_y_type"});
  with("scan_elements/in_accel_y_type", "-", -ENOENT, {"in_accel_y_type", "[imu] part"});
  with("scan_elements/in_anglvel_z_index", "first", -EBADMSG, {"in_anglvel_z_index", "\"first\""});
  with("in_anglvel_scale_available", "0.000133090 0.000266181", -ERANGE,
       {"in_anglvel_scale_available", "0.000266181", "choose a smaller"});
  with("in_anglvel_mount_matrix", "1, 0, 0; 0, 1, 0; 0, 0, 2", -EINVAL,
       {"in_anglvel_mount_matrix", "mount-matrix in the device tree"});
  with("in_accel_mount_matrix", "1, 0, 0; 0, 1, 0; 0, 0, -1", -EINVAL,
       {"in_accel_mount_matrix", "no rotation"});
  with("in_accel_mount_matrix", "1, 0, 0; 0, 1", -EINVAL, {"in_accel_mount_matrix"});
  with("trigger/current_trigger", "", -ENODATA, {"current_trigger", "[imu] trigger", "trigger*/name"});
  with("buffer/enable", "-", -ENOENT, {"buffer/enable"});
}

TEST_F(IioImuTest, SaysSoWhenTheScaleIsMissing) {
  addMpu();
  removeAttribute(dir_, "in_accel_scale");
  expectRefusal(-ENOENT, {"mpu9250", "in_accel_x_scale"});
}

TEST_F(IioImuTest, SaysSoWhenTheDriverKeepsAnotherRateOrScale) {
  addMpu();
  SyscallJournal::instance().onWrite("sampling_frequency",
                                     [&] { setAttribute(dir_, "sampling_frequency", "208"); });
  expectRefusal(-EINVAL, {"sampling_frequency", "\"208\"", "low_pass"});
  SyscallJournal::instance().clear();
  SyscallJournal::instance().onWrite("in_accel_scale",
                                     [&] { setAttribute(dir_, "in_accel_scale", "0.000598"); });
  setAttribute(dir_, "sampling_frequency", "");
  expectRefusal(-ERANGE, {"in_accel_scale", "0.000598"});
}

TEST_F(IioImuTest, SaysSoWhenTheBufferDoesNotStart) {
  addMpu();
  SyscallJournal::instance().onWrite("buffer/enable", [&] { setAttribute(dir_, "buffer/enable", "0"); });
  expectRefusal(-EIO, {"buffer/enable", "\"0\"", "dmesg"});
}

TEST_F(IioImuTest, SaysWhoHoldsTheDeviceAndWhatIsNotAllowed) {
  addMpu();
  SyscallJournal::instance().failOpen("iio:device3", EBUSY);
  expectRefusal(-EBUSY, {"/dev/iio:device3", "another process"});
  SyscallJournal::instance().failOpen("buffer/enable", EACCES);
  expectRefusal(-EACCES, {"buffer/enable", "udev rule"});
}

TEST_F(IioImuTest, SetsTheTriggerThatTheBoardNames) {
  addMpu();
  setAttribute(dir_, "trigger/current_trigger", "");
  trigger_ = "hrtimer-200";
  ASSERT_EQ(open(), 0) << fault_.where;
  EXPECT_EQ(attribute(dir_, "trigger/current_trigger"), "hrtimer-200");
}
}  // namespace
