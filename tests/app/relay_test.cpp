// The lines of `equipoise send --live`.
#include <gtest/gtest.h>

#include "app/run/conversation.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {
namespace {

TEST(LiveRequest, NamesAnAction) {
  EXPECT_EQ(live_request("arm")->action, std::int8_t{signed_command_t::ARM});
  EXPECT_EQ(live_request(" disarm ")->action, std::int8_t{signed_command_t::DISARM});
  EXPECT_EQ(live_request("heading-reset")->action, std::int8_t{signed_command_t::HEADING_RESET});
  EXPECT_EQ(live_request("take")->action, std::int8_t{signed_command_t::ASK});
}

TEST(LiveRequest, DrivesInTheUnitsOfTheCommandLine) {
  const auto request = live_request("drive 0.1 -0.2 0.5");
  ASSERT_TRUE(request);
  EXPECT_EQ(request->action, std::int8_t{signed_command_t::DRIVE});
  EXPECT_DOUBLE_EQ(request->motion.velocity_W_m_s[0], 0.1);
  EXPECT_DOUBLE_EQ(request->motion.velocity_W_m_s[1], -0.2);
  EXPECT_DOUBLE_EQ(request->motion.yaw_rate_rad_s, kPi);
}

TEST(LiveRequest, TakesNothingElse) {
  for (const char* line :
       {"", "ARM", "arm now", "drive", "drive 1", "drive 0 0 0 0", "drive a 0 0", "drive nan 0 0",
        "drive 2.1 0 0", "drive 0 -2.1 0", "drive 0 0 5.1", "drive 1e999 0 0"})
    EXPECT_FALSE(live_request(line)) << line;
}

}  // namespace
}  // namespace equipoise::app
