// The board files: what the drivers get, and what is refused.
#include "app/board/board.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "equipoise/config.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mip/config.hpp"

namespace equipoise::app {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::string kConfig = std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";
const std::string kBoards = std::string(EQUIPOISE_SOURCE_DIR) + "/config/boards/";

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string complaint(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  try {
    parse_board(text, "b.toml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Board, MbbrHasThreeDriveCoastBridgesAtTheWiringInItsFile) {
  const Board board = load_board(kBoards + "robotics_cape_mbbr.toml");
  EXPECT_EQ(board.robot, "mbbr");
  ASSERT_EQ(board.wiring.motors, 3u);
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(board.wiring.motor[i].bridge, BBB_MC33926);
    EXPECT_TRUE(board.wiring.motor[i].fault.used);
    EXPECT_TRUE(board.wiring.motor[i].fault.active_low);  // SF of an MC33926 is low on a fault
  }
  EXPECT_STREQ(board.wiring.motor[1].pwm, "48302200");
  EXPECT_EQ(board.wiring.motor[1].pwm_channel, 1u);
  EXPECT_STREQ(board.wiring.motor[2].encoder, "48304180");
  EXPECT_STREQ(board.wiring.imu.bus, "/dev/i2c-2");
  EXPECT_EQ(board.wiring.imu.address, 0x68);
  EXPECT_EQ(board.wiring.imu.interrupt.line, 21u);
  EXPECT_TRUE(board.wiring.imu.interrupt.active_low);
  EXPECT_EQ(board.wiring.pwm_hz, 20000u);
  EXPECT_EQ(board.led_bars.size(), 4u);
}

/// The MBBR's board with an IMU of the kernel's.
std::string iio_board(const std::string& imu) {
  std::string text = text_of(kBoards + "robotics_cape_mbbr.toml");
  const std::size_t begin = text.find("[imu]");
  return text.replace(begin, text.find("[bridges]") - begin,
                      "[imu]\ndriver = \"iio\"\nrate_hz = 200\ngyro_range_deg_s = 2000\naccel_range_g = 8\n"
                      "stuck_after_samples = 10\nlate_after_us = 1000\nR_BS = [1, 0, 0, 0, 1, 0, 0, 0, 1]\n" +
                          imu + "\n");
}

TEST(Board, TakesAnImuOfTheKernelsByItsPart) {
  const Board board = parse_board(iio_board("part = \"lsm6dso\"\nlow_pass = 2\ntrigger = \"t\""), "b.toml");
  EXPECT_EQ(board.wiring.imu.driver, BBB_IMU_IIO);
  EXPECT_STREQ(imu_part(board.wiring.imu.part)->gyro_device, "lsm6dso_gyro");
  EXPECT_EQ(imu_low_pass(board.wiring.imu.part, board.wiring.imu.dlpf)->rate_hz, 833);
  EXPECT_STREQ(board.wiring.imu.trigger, "t");
  EXPECT_EQ(board.facts.gyro_delay_s, 0.76e-3);
}

TEST(Board, RefusesALowPassThatTheKernelsDriverDoesNotSet) {
  const auto refusal = [](const std::string& imu) {
    const std::string text = iio_board(imu + "\n# here");
    return complaint(text, "# here", "");
  };
  EXPECT_THAT(refusal("part = \"icm42688\"\nlow_pass = 4"),
              AllOf(StartsWith("b.toml:"), HasSubstr("low_pass"), HasSubstr("1")));
  EXPECT_THAT(refusal("part = \"mpu9250\"\nlow_pass = 3"), HasSubstr("allowed: 1 to 2"))
      << "100 Hz: less than the loop";
  EXPECT_THAT(refusal("part = \"adis16470\"\nlow_pass = 1"), HasSubstr("icm42688"));
  EXPECT_THAT(refusal("part = \"bmi270\"\nlow_pass = 1\nbus = \"/dev/i2c-2\""), HasSubstr("bus"));
  EXPECT_EQ(refusal("part = \"bmi270\"\nlow_pass = 1"), "accepted");
}

/// One delay for driver, filter and simulated world: the configuration must have the board's.
TEST(Board, TheConfigurationHasTheDelayOfTheBoardsImu) {
  const auto load = [](const std::string& imu) -> std::string {
    try {
      load_mbbr(kConfig, overrides_of(parse_board(iio_board(imu), "b.toml")));
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(load("part = \"icm42688\"\nlow_pass = 1"),
              AllOf(HasSubstr("0.00225"), HasSubstr("chain.gyro_delay_s = 0.0039")));
  EXPECT_EQ(load("part = \"mpu6500\"\nlow_pass = 2"), "accepted");
}

TEST(Board, MipHasTwoDriveBrakeBridgesOneReversed) {
  const Board board = load_board(kBoards + "robotics_cape_edumip.toml");
  EXPECT_EQ(board.robot, "mip");
  ASSERT_EQ(board.wiring.motors, 2u);
  EXPECT_EQ(board.wiring.motor[0].bridge, BBB_TB6612);
  EXPECT_FALSE(board.wiring.motor[0].fault.used);
  // librobotcontrol: polarity {1, -1, -1, 1} of motors 1 to 4; rc_balance: right wheel motor 2, encoder 2,
  // sign -1; left wheel motor 3, encoder 3, sign +1.
  EXPECT_STREQ(board.wiring.motor[0].encoder, "48302180");
  EXPECT_FALSE(board.wiring.motor[0].motor_reversed);
  EXPECT_TRUE(board.wiring.motor[0].encoder_reversed);
  EXPECT_STREQ(board.wiring.motor[1].encoder, "48304180");
  EXPECT_TRUE(board.wiring.motor[1].motor_reversed);
  EXPECT_FALSE(board.wiring.motor[1].encoder_reversed);
}

TEST(Board, TheBlueIsTheSameRobotOnOtherPins) {
  const Board cape = load_board(kBoards + "robotics_cape_edumip.toml");
  const Board blue = load_board(kBoards + "beaglebone_blue_edumip.toml");
  EXPECT_EQ(cape.overlay, "cape");
  EXPECT_EQ(blue.overlay, "blue");
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(blue.wiring.motor[i].motor_reversed, cape.wiring.motor[i].motor_reversed);
    EXPECT_EQ(blue.wiring.motor[i].encoder_reversed, cape.wiring.motor[i].encoder_reversed);
    EXPECT_STREQ(blue.wiring.motor[i].pwm, cape.wiring.motor[i].pwm);
    EXPECT_STREQ(blue.wiring.motor[i].encoder, cape.wiring.motor[i].encoder);
  }
  // BeagleBoard.org's am335x-boneblue.dts: MDIR_2B is gpio0.10, the battery's second LED gpio0.11.
  EXPECT_STREQ(blue.wiring.motor[0].in2.chip, "44e07000");
  EXPECT_EQ(blue.wiring.motor[0].in2.line, 10u);
  EXPECT_EQ(blue.led_bars[1].line, 11);
}

TEST(Board, AnOverlayThatWeDoNotHaveIsRefused) {
  std::string text = text_of(kBoards + "robotics_cape_mbbr.toml");
  text.replace(text.find("\"cape\""), 6, "\"green\"");
  EXPECT_THROW(parse_board(text, "b.toml"), ConfigError);
}

// What loading this configuration says to a board file with one text replaced.
std::string contradiction(const std::string& from, const std::string& to,
                          const std::vector<std::string>& set = {}) {
  std::string text = text_of(kBoards + "robotics_cape_mbbr.toml");
  for (std::size_t at = 0; !from.empty() && (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  try {
    load_mbbr(kConfig, overrides_of(parse_board(text, "b.toml"), set));
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(Board, WhatStandsInTheConfigurationTooMustBeTheSame) {
  EXPECT_EQ(contradiction("", ""), "");
  EXPECT_THAT(contradiction("pwm_hz = 20000", "pwm_hz = 19000"),
              AllOf(StartsWith("b.toml: bridges.pwm_hz: 19000 where " + kConfig + ":"),
                    HasSubstr(" has motor.pwm_hz = 20000; both must say the same")));
  EXPECT_THAT(contradiction("mc33926\"", "tb6612\""),
              AllOf(HasSubstr("wired as drive_brake"), HasSubstr("has motor.bridge = drive_coast")));
  EXPECT_THAT(contradiction("[1, 0, 0, 0, 1, 0, 0, 0, 1]", "[0, -1, 0, 1, 0, 0, 0, 0, 1]"),
              HasSubstr("imu.R_BS[0]: 0 where"));
  EXPECT_THAT(contradiction("V_per_count = 0.004835164835", "V_per_count = 0.0048"),
              HasSubstr("battery.V_per_count: 0.0048 where"));
  EXPECT_THAT(contradiction("offset_V = -0.10", "offset_V = -0.11"), HasSubstr("battery.offset_V: -0.11"));
}

TEST(Board, OneBridgeOfAnotherTypeIsRefused) {
  EXPECT_THAT(
      complaint(text_of(kBoards + "robotics_cape_mbbr.toml"), "bridge = \"mc33926\"", "bridge = \"tb6612\""),
      HasSubstr("motor[1].bridge: differs from the first motor's"));
}

TEST(Board, AMountThatIsNoRotationIsRefusedWithItsLine) {
  EXPECT_THAT(complaint(text_of(kBoards + "robotics_cape_mbbr.toml"), "[1, 0, 0, 0, 1, 0, 0, 0, 1]",
                        "[1, 0, 0, 0, 1, 0, 0, 0, 0.5]"),
              StartsWith("b.toml:23: imu.R_BS: is not a rotation matrix"));
}

TEST(Board, WhatWasMeasuredReplacesTheConfigurationsAndIsLogged) {
  Board board = parse_board(text_of(kBoards + "robotics_cape_mbbr.toml"), "b.toml");
  board.measured.R_BS = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  board.measured.gyro_bias_B_rad_s = {0.1 + 0.2, -1e-17, 0.0};
  board.measured.accel_scale_S = {1.01, 0.99, 1.0};
  board.measured.accel_bias_B_m_s2 = {0.1, 0.2, 0.3};
  const Loaded<MbbrConfig> loaded =
      load_mbbr(kConfig, overrides_of(board, {"calibration.accel_bias_m_s2[2]=0.5"}));
  const Calibration& c = loaded.config.calibration;
  Mat3 turned;
  turned << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_EQ(c.R_BS, turned);
  EXPECT_EQ(c.gyro_bias_B_rad_s, Vec3(0.1 + 0.2, -1e-17, 0.0));
  EXPECT_EQ(c.accel_scale_S, Vec3(1.01, 0.99, 1.0));
  EXPECT_EQ(c.accel_bias_B_m_s2, Vec3(0.1, 0.2, 0.5));                          // --set has the last word
  const Calibration again = parse_mbbr(loaded.toml, "log").config.calibration;  // as replay will
  EXPECT_EQ(again.R_BS, c.R_BS);
  EXPECT_EQ(again.gyro_bias_B_rad_s, c.gyro_bias_B_rad_s);
  EXPECT_EQ(again.accel_bias_B_m_s2, c.accel_bias_B_m_s2);
}

TEST(Board, WrongKeysAreRefusedWithLineAndRange) {
  const std::string text = text_of(kBoards + "robotics_cape_mbbr.toml");
  EXPECT_EQ(complaint(text, "address = 0x68", "address = 0x99"),
            "b.toml:13: imu.address: 153 is out of range; allowed: 8 to 119");
  EXPECT_NE(complaint(text, "accel_range_g = 8", "accel_range_g = 7").find("allowed: 2, 4, 8, 16"),
            std::string::npos);
  EXPECT_NE(complaint(text, "[\"481ae000\", 21]", "[\"481ae000\", 92]").find("allowed: 0 to 91"),
            std::string::npos);
  EXPECT_NE(complaint(text, "[\"481ae000\", 21]", "[\"481ae000\"]").find("imu.interrupt: expected a pair"),
            std::string::npos);
  EXPECT_NE(complaint(text, "[\"481ae000\", 21]", "[\"\", 21]").find("names no gpio chip"),
            std::string::npos);
  EXPECT_NE(complaint(text, "pwm_channel = \"A\"", "pwm_channel = \"C\"").find("allowed: A, B"),
            std::string::npos);
  EXPECT_NE(complaint(text, "low_pass = 2", "lowpass = 2").find("imu.low_pass: missing"), std::string::npos);
  EXPECT_NE(complaint(text, "low_pass = 2", "low_pass = 2\nspeed = 1").find("imu.speed: unknown key"),
            std::string::npos);
  EXPECT_NE(
      complaint(text, "bus = \"/dev/i2c-2\"", "bus = \"" + std::string(64, 'x') + "\"").find("too long"),
      std::string::npos);
}

}  // namespace
}  // namespace equipoise::app
