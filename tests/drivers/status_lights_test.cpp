// The robot's own two LEDs, by the kernel's names: each shows its state, and none what has ended.
#include <chrono>
#include <thread>

#include "app/run/status_indicator.hpp"
#include "testbed.hpp"

namespace equipoise::app {
namespace {

class StatusLights : public Testbed {
 protected:
  /// Within a blink and a half.
  bool shows(const std::string& led, const char* level) const {
    for (int turn = 0; turn < 150 && attribute(led, "brightness") != level; ++turn)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return attribute(led, "brightness") == level;
  }
  const std::string green_ = addLed("green");
  const std::string red_ = addLed("red");
};

TEST_F(StatusLights, TellTheStateAndAreDarkAfterTheEnd) {
  for (const bool armed : {true, false}) {
    {
      StatusIndicator indicator((Board()));
      indicator.tell(armed ? ArmState::kArmed : ArmState::kDisarmed, armed ? 0U : std::uint32_t{kBatteryLow},
                     7.8);
      EXPECT_TRUE(shows(armed ? green_ : red_, "1"));
      EXPECT_TRUE(shows(armed ? red_ : green_, "0"));
    }
    EXPECT_EQ(attribute(green_, "brightness"), "0");
    EXPECT_EQ(attribute(red_, "brightness"), "0");
  }
}

}  // namespace
}  // namespace equipoise::app
