#include "app/run/panel.hpp"

#include <gtest/gtest.h>

namespace equipoise::app {
namespace {

Command full() {
  Command command;
  command.arm = true;
  command.velocity_W_m_s = Vec2(0.2, -0.1);
  command.yaw_rate_rad_s = 4.0;
  return command;
}

TEST(Panel, ModeCyclesFullHalfQuarterSpeedAndLeavesTheRestAlone) {
  PanelGate gate;
  const double shares[] = {1.0, 0.5, 0.25};
  for (std::size_t mode = 0; mode < 3; ++mode) {
    const Command allowed = gate.limit(full(), false, mode);
    EXPECT_DOUBLE_EQ(allowed.velocity_W_m_s.x(), 0.2 * shares[mode]);
    EXPECT_DOUBLE_EQ(allowed.velocity_W_m_s.y(), -0.1 * shares[mode]);
    EXPECT_DOUBLE_EQ(allowed.yaw_rate_rad_s, 4.0 * shares[mode]);
    EXPECT_TRUE(allowed.arm);
  }
}

TEST(Panel, PauseDisarmsAtOnce) {
  PanelGate gate;
  EXPECT_TRUE(gate.limit(full(), false, 0).arm);
  EXPECT_FALSE(gate.limit(full(), true, 0).arm);
}

TEST(Panel, AfterAPauseTheRobotArmsOnlyOnceArmingWasLetGo) {
  PanelGate gate;
  (void)gate.limit(full(), true, 0);
  EXPECT_FALSE(gate.limit(full(), false, 0).arm);  // the remote still asks: nothing starts under the hand
  Command released = full();
  released.arm = false;
  EXPECT_FALSE(gate.limit(released, false, 0).arm);
  EXPECT_TRUE(gate.limit(full(), false, 0).arm);
}

TEST(Panel, BarsShowTheSpeedAndBlinkWhilePaused) {
  const std::size_t steady[] = {4, 2, 1};
  for (std::size_t mode = 0; mode < 3; ++mode) {
    EXPECT_EQ(Panel::bars_lit(4, mode, false, false), steady[mode]);
    EXPECT_EQ(Panel::bars_lit(4, mode, false, true), steady[mode]);
    EXPECT_EQ(Panel::bars_lit(4, mode, true, true), steady[mode]);
    EXPECT_EQ(Panel::bars_lit(4, mode, true, false), 0u);
  }
  EXPECT_EQ(Panel::bars_lit(0, 0, false, false), 0u);
}

}  // namespace
}  // namespace equipoise::app
