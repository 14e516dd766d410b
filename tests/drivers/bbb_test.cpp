// The assembled board: what reaches the boundary, and that the motors are off whatever breaks.
#include "bbb.h"

#include <errno.h>

#include <cmath>

#include "board_fixture.hpp"
#include "monotonic.h"
#include "mpu9250_registers.h"

using BbbTest = BoardFixture;

TEST_F(BbbTest, DeliversAFullSampleAtTheEdge) {
  open();
  imu.setSample({100, -200, 4096}, {16, -32, 48});
  setAttribute(counter_[0], "count0/count", "10");
  setAttribute(counter_[1], "count0/count", "4294967295");
  setAttribute(counter_[2], "count0/count", "30");
  setAttribute(adc_, "in_voltage6_raw", "1700");
  const rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.valid, uint32_t{RIO_IMU | RIO_ENCODERS | RIO_BATTERY});
  EXPECT_EQ(sample.health, 0u);
  EXPECT_EQ(sample.t_ns, edge_ns_);
  EXPECT_EQ(sample.accel_counts[2], 4096.0);
  EXPECT_EQ(sample.gyro_counts[1], -32.0);
  EXPECT_EQ(sample.encoder_counts[0], 10.0);
  EXPECT_EQ(sample.encoder_counts[1], -1.0);
  EXPECT_EQ(sample.encoder_counts[2], -30.0) << "reversed in the board file";
  EXPECT_EQ(sample.battery_counts, 1700.0);
}

TEST_F(BbbTest, CountsAreTheBoundarysWhateverTheRange) {
  config_.imu.gyro_range_dps = 500;
  config_.imu.accel_range_g = 2;
  open();
  imu.setSample({0, 0, 16384}, {400, 0, 0});
  const rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.accel_counts[2], 4096.0);  // 1 g
  EXPECT_EQ(sample.gyro_counts[0], 100.0);
}

TEST_F(BbbTest, TellsTheChipsTemperature) {
  open();
  imu.setSample({0, 0, 4096}, {0, 0, 0});
  imu.setRegister(0x41, 0x0D);  // TEMP_OUT: 0x0D0B = 3339 counts, 10.0 K above 21 degC
  imu.setRegister(0x42, 0x0B);
  EXPECT_NEAR(tickAndRead().imu_temperature_degC, 31.0, 0.01);
}

TEST_F(BbbTest, ReturnsByTheDeadlineWhenTheInterruptIsLost) {
  open();
  tickAndRead();
  int64_t now_ns = 0;
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  EXPECT_EQ(FakeGpio::instance().last_deadline_ns, edge_ns_ + 5000000 + 1000000);
  EXPECT_GE(now_ns, FakeGpio::instance().last_deadline_ns);
  rio_sensors_t sample;
  ASSERT_EQ(rio_read_sensors(&io_, &sample), 0);
  EXPECT_EQ(sample.valid & (RIO_IMU | RIO_ATTITUDE), 0u);
  EXPECT_EQ(sample.health & RIO_IMU_LATE, uint32_t{RIO_IMU_LATE});
  EXPECT_NE(sample.valid & RIO_ENCODERS, 0u) << "the others are still read";
  const int64_t first = FakeGpio::instance().last_deadline_ns;
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  EXPECT_GE(FakeGpio::instance().last_deadline_ns, first + 5000000) << "the rhythm goes on, one period later";
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.late_ticks, 2u);
}

TEST_F(BbbTest, AFailingInterruptLineIsALateTickNotASpin) {
  open();
  tickAndRead();
  FakeGpio::instance().edge_error = -ENODEV;
  int64_t now_ns = 0;
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  EXPECT_GE(now_ns, edge_ns_ + 5000000);
  rio_sensors_t sample;
  ASSERT_EQ(rio_read_sensors(&io_, &sample), 0);
  EXPECT_NE(sample.health & RIO_IMU_LATE, 0u);
}

TEST_F(BbbTest, UsesTheNewestOfSeveralEdges) {
  open();
  const int64_t now = monotonic_ns();
  FakeGpio::instance().edges_ns = {now - 2, now - 1, now};
  int64_t now_ns = 0;
  ASSERT_EQ(rio_wait_tick(&io_, &now_ns), 0);
  rio_sensors_t sample;
  ASSERT_EQ(rio_read_sensors(&io_, &sample), 0);
  EXPECT_EQ(sample.t_ns, now);
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.missed_edges, 2u);
}

TEST_F(BbbTest, SensorFaultsClearTheirBitsAndNothingElse) {
  open();
  imu.failNext(EREMOTEIO);
  rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.valid, uint32_t{RIO_ENCODERS | RIO_BATTERY});
  EXPECT_EQ(sample.health, uint32_t{RIO_IMU_BUS_ERROR});
  EXPECT_EQ(sample.gyro_counts[0], 0.0);

  SyscallJournal::instance().failRead("count0/count", ENODEV);
  sample = tickAndRead();
  EXPECT_EQ(sample.valid, uint32_t{RIO_IMU | RIO_BATTERY});
  EXPECT_EQ(sample.health, uint32_t{RIO_ENCODER_ERROR});

  SyscallJournal::instance().failRead("in_voltage6_raw", EIO);
  for (uint32_t i = 0; i < config_.battery_every_ticks; ++i) sample = tickAndRead();
  EXPECT_EQ(sample.health & RIO_BATTERY_ERROR, uint32_t{RIO_BATTERY_ERROR});
  EXPECT_EQ(sample.valid & RIO_BATTERY, 0u);
}

TEST_F(BbbTest, ClippedIsReportedStuckIsRefused) {
  config_.imu.stuck_after = 2;
  open();
  imu.setSample({32767, 0, 0}, {0, 0, 0});
  rio_sensors_t sample = tickAndRead();
  EXPECT_NE(sample.valid & RIO_IMU, 0u);
  EXPECT_EQ(sample.health, uint32_t{RIO_IMU_CLIPPED});
  tickAndRead();
  sample = tickAndRead();
  EXPECT_EQ(sample.valid & RIO_IMU, 0u);
  EXPECT_EQ(sample.health, uint32_t{RIO_IMU_CLIPPED | RIO_IMU_STUCK});
}

TEST_F(BbbTest, BatteryIsConvertedOnlyEverySoOften) {
  config_.battery_every_ticks = 3;
  open();
  setAttribute(adc_, "in_voltage6_raw", "1000");
  EXPECT_EQ(tickAndRead().battery_counts, 1000.0);
  setAttribute(adc_, "in_voltage6_raw", "900");
  EXPECT_EQ(tickAndRead().battery_counts, 1000.0);
  EXPECT_EQ(tickAndRead().battery_counts, 1000.0);
  EXPECT_EQ(tickAndRead().battery_counts, 900.0);
}

TEST_F(BbbTest, DrivesThenEnablesAndCoastsOnDisable) {
  open();
  ASSERT_EQ(write(0.5, -0.25, 0.1), 0);
  EXPECT_TRUE(enableLine().active);
  EXPECT_EQ(duties(), (std::vector<std::string>{"25000", "12500", "5000"}));
  EXPECT_EQ(SyscallJournal::instance().lines().back(), "44e07000:20=1")
      << "awake only when all duties are set";
  rio_motors_t off{};
  ASSERT_EQ(rio_write_motors(&io_, &off), 0);
  expectMotorsOff();
}

TEST_F(BbbTest, NonFiniteDutyStopsEverything) {
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  EXPECT_EQ(write(0.5, NAN, 0.5), -EINVAL);
  expectMotorsOff();
}

TEST_F(BbbTest, OneFailingMotorStopsAllMotors) {
  for (const char* broken : {"48302200.pwm/pwm/pwmchip4/pwm0/duty_cycle", "pwmchip4/pwm1/duty_cycle",
                             "pwmchip7/pwm0/duty_cycle"}) {
    open();
    ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
    SyscallJournal::instance().failWrite(broken, EIO, 1);
    EXPECT_EQ(write(0.6, 0.6, 0.6), -EIO) << broken;
    expectMotorsOff();
    rio_close(&io_);
  }
}

TEST_F(BbbTest, MotorsOffReachesTheOthersWhenOneIsGone) {
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  SyscallJournal::instance().failWrite("pwmchip4/pwm0/duty_cycle", ENODEV, 1000);
  FakeGpio::instance().line("4804c000", 28).use_error = -ENODEV;
  EXPECT_EQ(rio_motors_off(&io_), -ENODEV);
  EXPECT_FALSE(enableLine().active);
  EXPECT_EQ(duties()[1], "0");
  EXPECT_EQ(duties()[2], "0");
}

TEST_F(BbbTest, AnEnableLineThatFailsStillLeavesDutiesZero) {
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  enableLine().use_error = -EIO;
  EXPECT_EQ(rio_motors_off(&io_), -EIO);
  EXPECT_EQ(duties(), (std::vector<std::string>{"0", "0", "0"}));
}

TEST_F(BbbTest, CloseLeavesMotorsOffAndNothingHeld) {
  open();
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  rio_close(&io_);
  expectMotorsOff();
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
}

TEST_F(BbbTest, BridgeFaultIsReportedWhileDriven) {
  open();
  FakeGpio::instance().line("4804c000", 17).active = true;
  ASSERT_EQ(write(0.0, 1.0, -1.0), 0);
  EXPECT_EQ(tickAndRead().health, 0u);  // the others are well
  ASSERT_EQ(write(1.0, 0.0, 0.0), 0);
  EXPECT_EQ(tickAndRead().health, uint32_t{RIO_BRIDGE_FAULT});
  bbb_status_t status;
  bbb_get_status(&io_, &status);
  EXPECT_EQ(status.bridge_faults[0], 1u);
  ASSERT_EQ(rio_motors_off(&io_), 0);
  EXPECT_EQ(tickAndRead().health, 0u);
}

TEST_F(BbbTest, GuardMayHoldTheEnableLine) {
  config_.enable_held_elsewhere = true;
  open();
  EXPECT_FALSE(enableLine().held);
  ASSERT_EQ(write(0.5, 0.5, 0.5), 0);
  EXPECT_EQ(duties()[0], "25000");
  EXPECT_EQ(rio_motors_off(&io_), 0);
}

TEST_F(BbbTest, BeforeTheFirstEdgeThereIsNoSample) {
  open();
  rio_sensors_t sample{};
  ASSERT_EQ(rio_read_sensors(&io_, &sample), 0);
  EXPECT_EQ(sample.valid & RIO_IMU, 0u);
  EXPECT_EQ(sample.health & RIO_IMU_LATE, uint32_t{RIO_IMU_LATE});
}

TEST_F(BbbTest, ABoardThatOpensHasNothingToComplainOf) {
  bbb_error_t error{};
  ASSERT_EQ(bbb_open(&config_, &io_, &error), 0);
  EXPECT_STREQ(error.text, "");
}

TEST_F(BbbTest, TheNumberOfMotorsAndTheirFrequencyHaveBounds) {
  const auto opened = [&](auto&& change) {
    const bbb_config_t kept = config_;
    change(config_);
    bbb_error_t error{};
    const int status = bbb_open(&config_, &io_, &error);
    if (status == 0) rio_close(&io_);
    io_ = {};
    config_ = kept;
    return status;
  };
  EXPECT_EQ(opened([](auto& c) { c.motors = 1; }), 0);
  EXPECT_EQ(opened([](auto& c) { c.motors = 0; }), -EINVAL);
  EXPECT_EQ(opened([](auto& c) { c.motors = RIO_MAX_MOTORS + 1; }), -EINVAL);
  EXPECT_EQ(opened([](auto& c) { c.pwm_hz = 100; }), 0);
  EXPECT_EQ(opened([](auto& c) { c.pwm_hz = 99; }), -EINVAL);
  EXPECT_EQ(opened([](auto& c) { c.pwm_hz = 100001; }), -EINVAL);
  EXPECT_EQ(opened([](auto& c) { c.imu.dmp_firmware[0] = 'x'; }), -ENOENT);  // a file of one letter
}

TEST_F(BbbTest, LeavesNoDescriptorOpenWhetherItOpensOrNot) {
  const SyscallJournal& journal = SyscallJournal::instance();
  open();
  EXPECT_GT(journal.openFiles(), 0);
  rio_close(&io_);
  io_ = {};
  EXPECT_EQ(journal.openFiles(), 0);
  imu.setWhoAmI(0x68);
  bbb_error_t error{};
  EXPECT_EQ(bbb_open(&config_, &io_, &error), -ENODEV);
  EXPECT_EQ(journal.openFiles(), 0);
  EXPECT_EQ(journal.strayCloses(), 0);
}

TEST_F(BbbTest, EveryMissingPartIsNamedAndLeavesMotorsOff) {
  struct Case {
    std::string name;
    std::function<void()> breakIt;
    int code;
    std::string text;
  };
  const std::vector<Case> cases = {
      {"enable line", [&] { enableLine().open_error = -EBUSY; }, -EBUSY,
       "bridge enable: gpio chip 44e07000 line 20"},
      {"pwm", [&] { config_.motor[2].pwm[3] = '9'; }, -ENODEV, "motor 3 pwm: 48394200 channel 0"},
      {"pwm period", [&] { config_.pwm_hz = 25000; }, -EINVAL, "motor 1 pwm: 48302200 channel 0"},
      {"direction", [&] { FakeGpio::instance().line("481ac000", 17).open_error = -EBUSY; }, -EBUSY,
       "motor 2 in2: gpio chip 481ac000 line 17"},
      {"status flag", [&] { FakeGpio::instance().line("4804c000", 17).open_error = -ENODEV; }, -ENODEV,
       "motor 1 status_flag: gpio chip 4804c000 line 17"},
      {"encoder", [&] { removeAttribute(counter_[1], "count0/ceiling"); }, -ENOENT,
       "encoder 2 eQEP: 48302180"},
      {"adc", [&] { removeAttribute(adc_, "in_voltage6_raw"); }, -ENOENT,
       "battery adc: TI-am335x-adc in_voltage6_raw"},
      {"imu bus", [&] { imu.failNext(EREMOTEIO); }, -EREMOTEIO, "imu: /dev/i2c-2 address 0x68"},
      {"imu chip", [&] { imu.setWhoAmI(0); }, -ENODEV, "imu: /dev/i2c-2 address 0x68"},
      {"interrupt", [&] { FakeGpio::instance().line("481ae000", 21).open_error = -EBUSY; }, -EBUSY,
       "imu data-ready interrupt: gpio chip 481ae000 line 21"},
      {"dmp range",
       [&] {
         config_.imu.accel_range_g = 4;
         snprintf(config_.imu.dmp_firmware, BBB_FILE_MAX, "/nonexistent/dmp.bin");
       },
       -EINVAL, "dmp: needs 2 g or 8 g"},
      {"dmp file", [&] { snprintf(config_.imu.dmp_firmware, BBB_FILE_MAX, "/nonexistent/dmp.bin"); }, -ENOENT,
       "dmp: /nonexistent/dmp.bin"},
      {"motors", [&] { config_.motors = 5; }, -EINVAL, "motors"},
      {"rate", [&] { config_.imu.rate_hz = 0; }, -EINVAL, "rate_hz"},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    resetBoard();
    c.breakIt();
    bbb_error_t error{};
    EXPECT_EQ(bbb_open(&config_, &io_, &error), c.code);
    EXPECT_EQ(error.code, c.code);
    EXPECT_THAT(error.text, ::testing::HasSubstr(c.text));
    EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
    EXPECT_EQ(duties(), (std::vector<std::string>{"0", "0", "0"}));
  }
}

TEST_F(BbbTest, DmpDeliversAttitudeAndItsFaults) {
  config_.imu.accel_range_g = 2;
  const std::string path = writeFile("dmp.bin", std::string(3062, 'x'));
  snprintf(config_.imu.dmp_firmware, sizeof config_.imu.dmp_firmware, "%s", path.c_str());
  open();
  rio_sensors_t sample = tickAndRead();
  EXPECT_EQ(sample.valid & RIO_ATTITUDE, 0u) << "no packet yet";
  imu.pushFifo(dmpPacket({0.8, 0.6, 0.0, 0.0}));
  sample = tickAndRead();
  EXPECT_EQ(sample.valid, uint32_t{RIO_IMU | RIO_ENCODERS | RIO_BATTERY | RIO_ATTITUDE});
  EXPECT_NEAR(sample.attitude_wxyz[1], 0.6, 1e-6);
  EXPECT_EQ(tickAndRead().valid & RIO_ATTITUDE, 0u) << "never the same packet twice";
  imu.pushFifo(std::vector<uint8_t>(20, 0x11));
  sample = tickAndRead();
  EXPECT_EQ(sample.health, uint32_t{RIO_DMP_BAD_PACKET});
  EXPECT_NE(sample.valid & RIO_IMU, 0u);
  tickAndRead();
  for (int i = 0; i < 40; ++i) imu.pushFifo(dmpPacket({1, 0, 0, 0}));
  EXPECT_EQ(tickAndRead().health, uint32_t{RIO_DMP_OVERFLOW});
}

TEST_F(BbbTest, DmpRunsAtEightGWithTheLargeFifo) {
  config_.imu.accel_range_g = 8;
  const std::string path = writeFile("dmp.bin", std::string(3062, 'x'));
  snprintf(config_.imu.dmp_firmware, sizeof config_.imu.dmp_firmware, "%s", path.c_str());
  open();
  EXPECT_EQ(imu.reg(MPU9250_ACCEL_CONFIG), 2 << 3);
  EXPECT_EQ(imu.reg(MPU9250_ACCEL_CONFIG_2), MPU9250_FIFO_1024 | config_.imu.dlpf);
  imu.pushFifo(dmpPacket({0.8, 0.6, 0.0, 0.0}));
  EXPECT_NE(tickAndRead().valid & RIO_ATTITUDE, 0u);
}

TEST_F(BbbTest, WrongDmpFileIsNamed) {
  config_.imu.accel_range_g = 2;
  const std::string path = writeFile("dmp.bin", std::string(3061, 'x'));
  snprintf(config_.imu.dmp_firmware, sizeof config_.imu.dmp_firmware, "%s", path.c_str());
  bbb_error_t error{};
  EXPECT_EQ(bbb_open(&config_, &io_, &error), -ENODATA);
  EXPECT_THAT(error.text, ::testing::HasSubstr(path));
  EXPECT_THAT(error.text, ::testing::HasSubstr("3062"));
}
