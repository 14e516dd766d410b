// Single drivers against the kernel's own subsystems: what umockdev's static files cannot show.
#include <adc.h>
#include <can.h>
#include <dmp.h>
#include <eqep.h>
#include <errno.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <mpu9250.h>
#include <pwm.h>
#include <unistd.h>

#include "bench.hpp"

namespace {
constexpr uint32_t kPeriod_ns = 50000;
constexpr mpu9250_config_t kImu = {"/dev/i2c-2", 0x68, 200, 2000, 8, 2, 0, true};

bool exported(const char* device, unsigned channel) {
  char chip[SYSFS_PATH_MAX];
  if (sysfs_find("/sys/class/pwm", "pwmchip", device, chip) != 0) return false;
  return access((std::string(chip) + "/pwm" + std::to_string(channel)).c_str(), F_OK) == 0;
}
}  // namespace

TEST(PwmHardware, ReachesTheModuleAndUnexportsAtTheEnd) {
  Bench bench;
  pwm_t pwm;
  ASSERT_FALSE(exported("48304200", 1));
  ASSERT_EQ(pwm_open(&pwm, "48304200", 1, kPeriod_ns), 0);
  EXPECT_TRUE(exported("48304200", 1));
  EXPECT_EQ(bench.pwm()[3].period_ns, kPeriod_ns);
  EXPECT_EQ(bench.pwm()[3].duty_ns, 0u);
  EXPECT_EQ(bench.pwm()[3].enabled, 1u);
  ASSERT_EQ(pwm_set_fraction(&pwm, 0.4), 0);
  EXPECT_EQ(bench.pwm()[3].duty_ns, 20000u);
  pwm_close(&pwm);
  EXPECT_EQ(bench.pwm()[3].duty_ns, 0u);
  EXPECT_EQ(bench.pwm()[3].enabled, 0u);
  EXPECT_FALSE(exported("48304200", 1));
}

TEST(PwmHardware, TakesOverAnExportedRunningChannelAndLeavesItExported) {
  Bench bench;
  pwm_t first;
  pwm_t second;
  ASSERT_EQ(pwm_open(&first, "48302200", 0, 40000), 0);
  ASSERT_EQ(pwm_set_ns(&first, 40000), 0);
  ASSERT_EQ(pwm_open(&second, "48302200", 0, 20000), 0) << "a shorter period than the old on-time";
  EXPECT_EQ(bench.pwm()[0].period_ns, 20000u);
  EXPECT_EQ(bench.pwm()[0].duty_ns, 0u);
  pwm_close(&second);
  EXPECT_TRUE(exported("48302200", 0));
  pwm_close(&first);
  EXPECT_FALSE(exported("48302200", 0));
}

TEST(PwmHardware, TheModuleRefusesASecondPeriod) {
  Bench bench;
  pwm_t a;
  pwm_t b;
  ASSERT_EQ(pwm_open(&a, "48302200", 0, kPeriod_ns), 0);
  EXPECT_EQ(pwm_open(&b, "48302200", 1, 40000), -EINVAL);
  EXPECT_FALSE(exported("48302200", 1)) << "nothing left behind";
  ASSERT_EQ(pwm_open(&b, "48302200", 1, kPeriod_ns), 0);
  pwm_close(&b);
  pwm_close(&a);
}

TEST(PwmHardware, PassesOnTheKernelsError) {
  Bench bench;
  pwm_t pwm;
  ASSERT_EQ(pwm_open(&pwm, "48302200", 0, kPeriod_ns), 0);
  bench.fault("pwm", EBUSY, 1);
  EXPECT_EQ(pwm_set_ns(&pwm, 100), -EBUSY);
  EXPECT_EQ(pwm_set_ns(&pwm, 100), 0);
  pwm_close(&pwm);
}

TEST(EqepHardware, CountsAcrossTheWrapBothWays) {
  Bench bench;
  eqep_t encoder;
  bench.setCounts({5, 0, 0});
  ASSERT_EQ(eqep_open(&encoder, "48300180"), 0);
  int64_t counts = -1;
  const auto at = [&](int64_t position) {
    bench.setCounts({position, 0, 0});
    EXPECT_EQ(eqep_read(&encoder, &counts), 0);
    return counts;
  };
  EXPECT_EQ(at(5), 0);
  EXPECT_EQ(at(-3), -8) << "the counter shows 4294967293";
  EXPECT_EQ(at(2000000000), 1999999995);
  EXPECT_EQ(at(4000000000), 3999999995);
  EXPECT_EQ(at(6000000000), 5999999995);
  eqep_close(&encoder);
}

TEST(EqepHardware, EachAddressHasItsOwnWheel) {
  Bench bench;
  const char* devices[] = {"48300180", "48302180", "48304180"};
  eqep_t encoder[3];
  for (int i = 0; i < 3; ++i) ASSERT_EQ(eqep_open(&encoder[i], devices[i]), 0);
  bench.setCounts({11, -22, 33});
  const int64_t expected[] = {11, -22, 33};
  for (int i = 0; i < 3; ++i) {
    int64_t counts = 0;
    ASSERT_EQ(eqep_read(&encoder[i], &counts), 0);
    EXPECT_EQ(counts, expected[i]);
    eqep_close(&encoder[i]);
  }
}

TEST(AdcHardware, ReadsConversionsAndErrors) {
  Bench bench;
  adc_t adc;
  ASSERT_EQ(adc_open(&adc, "TI-am335x-adc", 6), 0);
  int32_t counts = 0;
  bench.setAdc(6, 1701);
  ASSERT_EQ(adc_read(&adc, &counts), 0);
  EXPECT_EQ(counts, 1701);
  bench.fault("adc", ETIMEDOUT, 1);
  EXPECT_EQ(adc_read(&adc, &counts), -ETIMEDOUT);
  adc_close(&adc);
}

TEST(ImuHardware, ConfiguresAndReadsThroughI2cDev) {
  Bench bench;
  mpu9250_t imu;
  ASSERT_EQ(mpu9250_open(&imu, &kImu), 0);
  EXPECT_EQ(bench.imuRegister(0x19), 4);
  EXPECT_EQ(bench.imuRegister(0x38), 1);
  bench.setImu({1, -2, 4096}, {-300, 400, 32767});
  mpu9250_sample_t sample;
  ASSERT_EQ(mpu9250_read(&imu, &sample), 0);
  EXPECT_EQ(sample.accel[1], -2);
  EXPECT_EQ(sample.gyro[0], -300);
  EXPECT_EQ(sample.flags, uint32_t{MPU9250_CLIPPED});
  bench.fault("imu", EREMOTEIO, 1);
  EXPECT_EQ(mpu9250_read(&imu, &sample), -EREMOTEIO);
  EXPECT_EQ(mpu9250_read(&imu, &sample), 0);
  mpu9250_close(&imu);
  EXPECT_EQ(bench.imuRegister(0x6B), 0x40);
}

TEST(ImuHardware, LoadsTheDmpAndReadsItsPackets) {
  Bench bench;
  mpu9250_t imu;
  ASSERT_EQ(mpu9250_open(&imu, &kImu), 0);
  std::vector<uint8_t> firmware(DMP_FIRMWARE_BYTES);
  for (size_t i = 0; i < firmware.size(); ++i) firmware[i] = static_cast<uint8_t>(i * 7 + i / 256);
  dmp_t dmp;
  ASSERT_EQ(dmp_start(&dmp, &imu.i2c, firmware.data()), 0);
  EXPECT_EQ(bench.imuRegister(0x6A), 0xC0);
  dmp_packet_t packet;
  EXPECT_EQ(dmp_poll(&dmp, &packet), -EAGAIN);
  std::vector<uint8_t> bytes(20, 0);
  bytes[0] = 0x40;  // w = 1 in Q30
  bench.pushFifo(bytes);
  ASSERT_EQ(dmp_poll(&dmp, &packet), 0);
  EXPECT_DOUBLE_EQ(packet.attitude_wxyz[0], 1.0);
  for (int i = 0; i < 60; ++i) bench.pushFifo(bytes);
  EXPECT_EQ(dmp_poll(&dmp, &packet), -EOVERFLOW);
  EXPECT_EQ(dmp_poll(&dmp, &packet), -EBUSY);
  bench.pushFifo(bytes);
  EXPECT_EQ(dmp_poll(&dmp, &packet), 0);
  mpu9250_close(&imu);
}

TEST(CanHardware, FramesCrossAVirtualBus) {
  can_port_t a;
  can_port_t b;
  ASSERT_EQ(can_open(&a, "can9"), 0);
  ASSERT_EQ(can_open(&b, "can9"), 0);
  can_frame frame{};
  frame.can_id = 0x123;
  frame.can_dlc = 8;
  frame.data[7] = 0xA5;
  can_frame seen{};
  EXPECT_EQ(can_receive(&b, &seen), -EAGAIN);
  ASSERT_EQ(can_send(&a, &frame), 0);
  ASSERT_EQ(can_receive(&b, &seen), 0);
  EXPECT_EQ(seen.can_id, 0x123u);
  EXPECT_EQ(seen.data[7], 0xA5);
  EXPECT_EQ(can_receive(&a, &seen), -EAGAIN) << "one's own frames do not come back";
  ASSERT_EQ(system("busybox ip link set can9 down"), 0);
  EXPECT_EQ(can_send(&a, &frame), -ENETDOWN);
  can_port_t c;
  EXPECT_EQ(can_open(&c, "can9"), -ENETDOWN);
  EXPECT_EQ(can_open(&c, "can8"), -ENODEV);
  ASSERT_EQ(system("busybox ip link set can9 up"), 0);
  can_close(&a);
  can_close(&b);
}

TEST(CanHardware, ErrorFramesTellTheBusState) {
  can_port_t port;
  can_port_t controller;  // plays it: error frames sent into a virtual bus arrive as a controller's would
  ASSERT_EQ(can_open(&port, "can9"), 0);
  ASSERT_EQ(can_open(&controller, "can9"), 0);
  const auto stateAfter = [&](canid_t kind, uint8_t detail) {
    can_frame frame{};
    frame.can_id = CAN_ERR_FLAG | kind;
    frame.can_dlc = CAN_ERR_DLC;
    frame.data[1] = detail;
    EXPECT_EQ(can_send(&controller, &frame), 0);
    can_frame seen{};
    EXPECT_EQ(can_receive(&port, &seen), -EAGAIN);
    return port.state;
  };
  EXPECT_EQ(stateAfter(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING), CAN_BUS_WARNING);
  EXPECT_EQ(stateAfter(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE), CAN_BUS_PASSIVE);
  EXPECT_EQ(stateAfter(CAN_ERR_BUSOFF, 0), CAN_BUS_OFF);
  EXPECT_EQ(port.bus_offs, 1u);
  EXPECT_EQ(stateAfter(CAN_ERR_RESTARTED, 0), CAN_BUS_ACTIVE);
  can_close(&port);
  can_close(&controller);
}

TEST(UnplugHardware, KeptDescriptorsReportTheMissingDeviceAndItComesBack) {
  Bench bench;
  pwm_t pwm;
  eqep_t encoder;
  ASSERT_EQ(pwm_open(&pwm, "48304200", 0, kPeriod_ns), 0);
  ASSERT_EQ(eqep_open(&encoder, "48304180"), 0);
  bench.unplug("48304200");
  bench.unplug("48304180");
  EXPECT_EQ(pwm_set_ns(&pwm, 100), -ENODEV);
  int64_t counts = 0;
  EXPECT_EQ(eqep_read(&encoder, &counts), -ENODEV);
  pwm_close(&pwm);
  eqep_close(&encoder);
  EXPECT_EQ(pwm_open(&pwm, "48304200", 0, kPeriod_ns), -ENODEV);
  EXPECT_EQ(eqep_open(&encoder, "48304180"), -ENODEV);
  bench.plug("48304200");
  bench.plug("48304180");
  ASSERT_EQ(pwm_open(&pwm, "48304200", 0, kPeriod_ns), 0);
  EXPECT_EQ(eqep_open(&encoder, "48304180"), 0);
  pwm_close(&pwm);
  eqep_close(&encoder);
}
