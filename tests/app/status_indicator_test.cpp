#include "app/run/status_indicator.hpp"

#include <gtest/gtest.h>

#include <chrono>

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
}

}  // namespace
}  // namespace equipoise::app
