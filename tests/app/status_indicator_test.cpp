#include "app/run/status_indicator.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>

namespace equipoise::app {
namespace {

TEST(StatusIndicator, LightsTellArmedReadyAndForbidden) {
  for (unsigned turn = 0; turn < 30; ++turn) {
    const auto armed = StatusIndicator::lights(ArmState::kArmed, 0, turn);
    EXPECT_TRUE(armed.green && !armed.red);
    const auto ready = StatusIndicator::lights(ArmState::kDisarmed, kNotRequested, turn);
    EXPECT_EQ(ready.green,
              turn * StatusIndicator::kTurn % std::chrono::seconds(1) >= std::chrono::milliseconds(500))
        << "a blink a second, turn " << turn;
    EXPECT_FALSE(ready.red);
    const auto forbidden = StatusIndicator::lights(ArmState::kDisarmed, kNotRequested | kBatteryLow, turn);
    EXPECT_TRUE(!forbidden.green && forbidden.red);
  }
}

TEST(StatusIndicator, WhatCannotBeOpenedIsAWarning) {
  Board board;
  board.led_green = {"/dev/no-such-chip", 1};
  board.led_red = {"/dev/null", 2};
  testing::internal::CaptureStderr();
  { const StatusIndicator without_can(board); }
  const std::string lights = testing::internal::GetCapturedStderr();
  EXPECT_NE(lights.find("warning: LED green: "), std::string::npos) << lights;
  EXPECT_NE(lights.find("warning: LED red: "), std::string::npos) << lights;
  EXPECT_EQ(lights.find("CAN"), std::string::npos) << lights;
  board.can_interface = "no-such-can";
  testing::internal::CaptureStderr();
  {
    StatusIndicator indicator(board);
    indicator.tell(ArmState::kArmed, 0, 7.8);
    std::this_thread::sleep_for(2 * StatusIndicator::kTurn);
  }
  const std::string all = testing::internal::GetCapturedStderr();
  EXPECT_NE(all.find("warning: no status on CAN: no-such-can: "), std::string::npos) << all;
}

TEST(StatusIndicator, FrameHoldsEveryReason) {
  const std::uint32_t reasons = kWheelFour | kTilt | kNotRequested;
  const can_frame frame =
      StatusIndicator::frame(std::uint64_t{reasons} | std::uint64_t{2} << 32U | std::uint64_t{78} << 40U);
  EXPECT_EQ(frame.can_id, 0x1E0U);
  EXPECT_EQ(frame.can_dlc, 8);
  EXPECT_EQ(frame.data[0], 2);
  EXPECT_EQ(frame.data[1], 78);  // 7.8 V
  std::uint32_t read = 0;
  for (unsigned i = 0; i < 4; ++i) read |= std::uint32_t{frame.data[2 + i]} << (8U * i);
  EXPECT_EQ(read, reasons);
  EXPECT_EQ(frame.data[6], 0);
  EXPECT_EQ(frame.data[7], 0);
}

}  // namespace
}  // namespace equipoise::app
