// The board files: what the drivers get, and what is refused.
#include "app/board/board.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "equipoise/config.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mip/config.hpp"

namespace equipoise::app {
namespace {

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

TEST(Board, MipHasTwoDriveBrakeBridgesOneReversed) {
  const Board board = load_board(kBoards + "robotics_cape_edumip.toml");
  EXPECT_EQ(board.robot, "mip");
  ASSERT_EQ(board.wiring.motors, 2u);
  EXPECT_EQ(board.wiring.motor[0].bridge, BBB_TB6612);
  EXPECT_FALSE(board.wiring.motor[0].fault.used);
  EXPECT_FALSE(board.wiring.motor[0].motor_reversed);
  EXPECT_TRUE(board.wiring.motor[1].motor_reversed);
  EXPECT_TRUE(board.wiring.motor[1].encoder_reversed);
}

TEST(Board, ItsMountAndBatteryScaleReplaceTheConfigurations) {
  const std::string text = text_of(kBoards + "robotics_cape_mbbr.toml");
  std::string turned = text;
  const std::string mount = "[1, 0, 0, 0, 1, 0, 0, 0, 1]";
  turned.replace(turned.find(mount), mount.size(), "[0, -1, 0, 1, 0, 0, 0, 0, 1]");
  const Board board = parse_board(turned, "b.toml");
  const Loaded<MbbrConfig> loaded =
      load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", board.calibration);
  Mat3 expected;
  expected << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_EQ(loaded.config.calibration.R_BS, expected);
  EXPECT_EQ(loaded.config.calibration.battery_V_per_count, 0.004835164835);
  EXPECT_EQ(loaded.config.calibration.battery_offset_V, -0.10);
}

TEST(Board, WrongKeysAreRefusedWithLineAndRange) {
  const std::string text = text_of(kBoards + "robotics_cape_mbbr.toml");
  EXPECT_EQ(complaint(text, "address = 0x68", "address = 0x99"),
            "b.toml:12: imu.address: 153 is out of range; allowed: 8 to 119");
  EXPECT_NE(complaint(text, "accel_range_g = 8", "accel_range_g = 7").find("allowed: 2, 4, 8, 16"),
            std::string::npos);
  EXPECT_NE(complaint(text, "[\"481ae000\", 21]", "[\"481ae000\", 32]").find("allowed: 0 to 31"),
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
