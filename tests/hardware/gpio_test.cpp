// Real lines of real (simulated) gpio chips through the kernel's character device.
#include <errno.h>
#include <gpio.h>
#include <gtest/gtest.h>
#include <monotonic.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench.hpp"

namespace {
class GpioHardware : public ::testing::Test {
 protected:
  void TearDown() override { gpio_close(&line_); }
  Bench bench_;
  gpio_line_t line_{};
};
}  // namespace

TEST_F(GpioHardware, OutputsReachThePin) {
  const gpio_pin_t pin = {"44e07000", 20, false};
  ASSERT_EQ(gpio_open_output(&line_, &pin, false), 0);
  EXPECT_FALSE(bench_.pin("44e07000", 20));
  ASSERT_EQ(gpio_set(&line_, true), 0);
  EXPECT_TRUE(bench_.pin("44e07000", 20));
  EXPECT_EQ(gpio_get(&line_), 1);
  ASSERT_EQ(gpio_set(&line_, false), 0);
  EXPECT_FALSE(bench_.pin("44e07000", 20));
}

TEST_F(GpioHardware, ActiveLowTurnsTheLevelRound) {
  const gpio_pin_t pin = {"4804c000", 3, true};
  ASSERT_EQ(gpio_open_output(&line_, &pin, true), 0);
  EXPECT_FALSE(bench_.pin("4804c000", 3));
  ASSERT_EQ(gpio_set(&line_, false), 0);
  EXPECT_TRUE(bench_.pin("4804c000", 3));
  gpio_close(&line_);
  bench_.drivePin("4804c000", 3, false);
  ASSERT_EQ(gpio_open_input(&line_, &pin), 0);
  EXPECT_EQ(gpio_get(&line_), 1);
  bench_.drivePin("4804c000", 3, true);
  EXPECT_EQ(gpio_get(&line_), 0);
}

TEST_F(GpioHardware, AHeldLineIsBusyAndAMissingOneInvalid) {
  const gpio_pin_t pin = {"481ac000", 9, false};
  ASSERT_EQ(gpio_open_output(&line_, &pin, false), 0);
  gpio_line_t second{};
  EXPECT_EQ(gpio_open_output(&second, &pin, false), -EBUSY);
  EXPECT_EQ(gpio_open_input(&second, &pin), -EBUSY);
  const gpio_pin_t beyond = {"481ac000", 32, false};
  EXPECT_EQ(gpio_open_input(&second, &beyond), -EINVAL);
  const gpio_pin_t nowhere = {"gpio-96-127", 0, false};
  EXPECT_EQ(gpio_open_input(&second, &nowhere), -ENODEV);
  gpio_close(&line_);
  EXPECT_EQ(gpio_open_input(&second, &pin), 0) << "free again";
  gpio_close(&second);
}

TEST_F(GpioHardware, EdgesCarryTheirMonotonicTime) {
  const gpio_pin_t pin = {"481ae000", 21, true};
  ASSERT_EQ(gpio_open_edge(&line_, &pin, GPIO_FALLING), 0);
  const int64_t before_ns = monotonic_ns();
  bench_.dataReady();
  const int64_t after_ns = monotonic_ns();
  int64_t edge_ns = 0;
  ASSERT_EQ(gpio_wait_edge(&line_, after_ns + 1000000000, &edge_ns), 1) << "the rising edge does not count";
  EXPECT_GE(edge_ns, before_ns);
  EXPECT_LE(edge_ns, after_ns + 1000000000);
}

TEST_F(GpioHardware, SeveralEdgesAreOneAnswerWithTheNewestTime) {
  const gpio_pin_t pin = {"481ae000", 21, true};
  ASSERT_EQ(gpio_open_edge(&line_, &pin, GPIO_FALLING), 0);
  bench_.dataReady();
  bench_.dataReady();
  const int64_t before_last_ns = monotonic_ns();
  bench_.dataReady();
  int64_t edge_ns = 0;
  int edges = 0;
  while (edge_ns < before_last_ns) {  // the simulated interrupt may merge edges, but not lose the last
    const int more = gpio_wait_edge(&line_, monotonic_ns() + 5000000000, &edge_ns);
    ASSERT_GT(more, 0);
    edges += more;
  }
  EXPECT_LE(edges, 3);
  EXPECT_EQ(gpio_wait_edge(&line_, monotonic_ns() + 2000000, &edge_ns), 0);
}

TEST_F(GpioHardware, WithoutAnEdgeTheDeadlineEndsTheWait) {
  const gpio_pin_t pin = {"481ae000", 21, true};
  ASSERT_EQ(gpio_open_edge(&line_, &pin, GPIO_FALLING), 0);
  int64_t edge_ns = 0;
  const int64_t deadline_ns = monotonic_ns() + 10000000;
  EXPECT_EQ(gpio_wait_edge(&line_, deadline_ns, &edge_ns), 0);
  EXPECT_GE(monotonic_ns(), deadline_ns);
}

TEST_F(GpioHardware, AButtonTellsOfEachPressOnceAndNotOfBounces) {
  const gpio_pin_t pin = {"481ac000", 5, true};
  const auto level = [this](bool high) { bench_.drivePin("481ac000", 5, high); };
  const auto pressed = [this](int64_t within_ns) {
    return gpio_wait_presses(&line_, 1, monotonic_ns() + within_ns);
  };
  constexpr int64_t kSecond_ns = 1000000000;
  level(false);
  ASSERT_EQ(gpio_open_press(&line_, &pin, 10000), 0);
  EXPECT_EQ(pressed(kSecond_ns / 4), 0) << "down since before: no press";
  level(true);
  EXPECT_EQ(pressed(kSecond_ns / 4), 0) << "let go of";
  for (const bool high : {false, true}) level(high);
  EXPECT_EQ(pressed(kSecond_ns / 4), 0) << "shorter than a press";
  for (const bool high : {false, true, false, true, false}) level(high);
  EXPECT_EQ(pressed(10 * kSecond_ns), 1);
  EXPECT_EQ(pressed(kSecond_ns / 4), 0);
  level(true);
}

TEST_F(GpioHardware, ADeadProcessLosesItsLines) {
  const gpio_pin_t pin = {"44e07000", 20, false};
  const pid_t child = fork();
  if (child == 0) {
    gpio_line_t line;
    if (gpio_open_output(&line, &pin, true) == 0) pause();
    _exit(1);
  }
  for (int i = 0; i < 1000 && !bench_.pin("44e07000", 20); ++i) usleep(10000);
  ASSERT_TRUE(bench_.pin("44e07000", 20));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_EQ(gpio_open_output(&line_, &pin, false), 0);
  EXPECT_FALSE(bench_.pin("44e07000", 20));
}
