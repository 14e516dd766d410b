#include <errno.h>

#include "button.h"
#include "fake_gpio.hpp"
#include "led.h"
#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
class LedButtonTest : public Testbed {
 protected:
  void SetUp() override { FakeGpio::instance().clear(); }
  const gpio_pin_t pin_ = {"gpio2", 2, false};
};
}  // namespace

TEST_F(LedButtonTest, LedPrefersTheKernelsName) {
  const std::string dir = addLed("red");
  led_t led;
  ASSERT_EQ(led_open(&led, "red", &pin_), 0);
  EXPECT_EQ(FakeGpio::instance().heldLines(), 0);
  ASSERT_EQ(led_set(&led, true), 0);
  EXPECT_EQ(attribute(dir, "brightness"), "1");
  led_close(&led);
  EXPECT_EQ(attribute(dir, "brightness"), "0");
}

TEST_F(LedButtonTest, LedFallsBackToItsLine) {
  led_t led;
  ASSERT_EQ(led_open(&led, "red", &pin_), 0);
  FakeGpio::Line& line = FakeGpio::instance().line("gpio2", 2);
  EXPECT_TRUE(line.output && !line.active);
  ASSERT_EQ(led_set(&led, true), 0);
  EXPECT_TRUE(line.active);
  led_close(&led);
  EXPECT_FALSE(line.active || line.held);
}

TEST_F(LedButtonTest, LedReportsWhatIsMissing) {
  led_t led;
  EXPECT_EQ(led_open(&led, "red", nullptr), -ENOENT);
  EXPECT_EQ(led_open(&led, nullptr, nullptr), -ENODEV);
  FakeGpio::instance().line("gpio2", 2).open_error = -EBUSY;
  EXPECT_EQ(led_open(&led, "red", &pin_), -EBUSY);
}

TEST_F(LedButtonTest, LedStartsDarkAndIsClosedOnce) {
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

TEST_F(LedButtonTest, LedNameThatIsTooLongIsAnError) {
  led_t led;
  EXPECT_EQ(led_open(&led, std::string(300, 'x').c_str(), &pin_), -ENAMETOOLONG);
}

TEST_F(LedButtonTest, AButtonThatCannotBeReadIsNotHeld) {
  FakeGpio::Line& line = FakeGpio::instance().line("gpio2", 2);
  button_t button;
  line.open_error = -EBUSY;
  EXPECT_EQ(button_open(&button, &pin_, 2), -EBUSY);
  line.open_error = 0;
  line.use_error = -EIO;
  EXPECT_EQ(button_open(&button, &pin_, 2), -EIO);
  EXPECT_FALSE(line.held);
}

TEST(ButtonFilter, ReportsAPressOnceAndIgnoresBounce) {
  button_filter_t filter{};
  filter.stable_polls = 3;
  const std::vector<bool> levels = {0, 1, 0, 1, 1, 0, 1, 1, 1, 1, 1, 0, 1, 1, 0, 0, 0, 1, 1, 1};
  std::vector<size_t> presses;
  for (size_t i = 0; i < levels.size(); ++i) {
    if (button_filter_update(&filter, levels[i])) presses.push_back(i);
  }
  EXPECT_EQ(presses, (std::vector<size_t>{8, 19}));
}

TEST_F(LedButtonTest, AButtonThatIsDownAlreadyIsNoPress) {
  const gpio_pin_t pin = {"gpio2", 5, true};
  button_t button;
  FakeGpio::Line& line = FakeGpio::instance().line("gpio2", 5);
  line.active = true;
  ASSERT_EQ(button_open(&button, &pin, 2), 0);
  bool pressed = false;
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(button_poll(&button, &pressed), 0);
    EXPECT_FALSE(pressed);
  }
  int presses = 0;
  for (const bool level : {false, false, true, true, true}) {
    line.active = level;
    ASSERT_EQ(button_poll(&button, &pressed), 0);
    presses += pressed ? 1 : 0;
  }
  EXPECT_EQ(presses, 1);
  button_close(&button);
}

TEST_F(LedButtonTest, ButtonReadsItsLine) {
  const gpio_pin_t pin = {"gpio2", 5, true};
  button_t button;
  ASSERT_EQ(button_open(&button, &pin, 2), 0);
  FakeGpio::Line& line = FakeGpio::instance().line("gpio2", 5);
  EXPECT_TRUE(line.active_low && !line.output);
  bool pressed = false;
  line.active = true;
  ASSERT_EQ(button_poll(&button, &pressed), 0);
  EXPECT_FALSE(pressed);
  ASSERT_EQ(button_poll(&button, &pressed), 0);
  EXPECT_TRUE(pressed);
  line.use_error = -ENODEV;
  EXPECT_EQ(button_poll(&button, &pressed), -ENODEV);
  EXPECT_FALSE(pressed);
  button_close(&button);
  EXPECT_FALSE(line.held);
}
