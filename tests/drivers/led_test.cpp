#include "led.h"

#include <errno.h>

#include "fake_gpio.hpp"
#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
class LedTest : public Testbed {
 protected:
  void SetUp() override { FakeGpio::instance().clear(); }
  const gpio_pin_t pin_ = {"gpio2", 2, false};
};
}  // namespace

TEST_F(LedTest, LedPrefersTheKernelsName) {
  const std::string dir = addLed("red");
  led_t led;
  ASSERT_EQ(led_open(&led, "red", &pin_), 0);
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  ASSERT_EQ(led_set(&led, true), 0);
  EXPECT_EQ(attribute(dir, "brightness"), "1");
  led_close(&led);
  EXPECT_EQ(attribute(dir, "brightness"), "0");
}

TEST_F(LedTest, LedFallsBackToItsLine) {
  led_t led;
  ASSERT_EQ(led_open(&led, "red", &pin_), 0);
  FakeGpio::Line& line = FakeGpio::instance().line("gpio2", 2);
  EXPECT_TRUE(line.output && !line.active);
  ASSERT_EQ(led_set(&led, true), 0);
  EXPECT_TRUE(line.active);
  led_close(&led);
  EXPECT_FALSE(line.active || line.held);
}

TEST_F(LedTest, LedReportsWhatIsMissing) {
  led_t led;
  EXPECT_EQ(led_open(&led, "red", nullptr), -ENOENT);
  EXPECT_EQ(led_open(&led, nullptr, nullptr), -ENODEV);
  FakeGpio::instance().line("gpio2", 2).open_error = -EBUSY;
  EXPECT_EQ(led_open(&led, "red", &pin_), -EBUSY);
}

TEST_F(LedTest, LedStartsDarkAndIsClosedOnce) {
  const std::string dir = addLed("red");
  setAttribute(dir, "brightness", "1");
  const NoStdin none;
  led_t led;
  ASSERT_EQ(led_open(&led, "red", nullptr), 0);
  EXPECT_EQ(led.fd, 0) << "a descriptor like any other";
  EXPECT_EQ(attribute(dir, "brightness"), "0");
  ASSERT_EQ(led_set(&led, true), 0);
  EXPECT_EQ(attribute(dir, "brightness"), "1");
  led_close(&led);
  EXPECT_EQ(led.fd, -1);
  EXPECT_EQ(attribute(dir, "brightness"), "0");
  led_close(&led);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
}

TEST_F(LedTest, LedNameThatIsTooLongIsAnError) {
  led_t led;
  EXPECT_EQ(led_open(&led, std::string(300, 'x').c_str(), &pin_), -ENAMETOOLONG);
}
