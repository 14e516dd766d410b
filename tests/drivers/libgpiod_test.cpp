// The libgpiod shim itself, as far as umockdev goes: finding chips and the errors of asking for a line.
// Levels and edges of real lines are tested in the virtual machine (tests/hardware).
#include <errno.h>
#include <gpio.h>
#include <linux/gpio.h>

#include <cstring>
#include <string>

#include "monotonic.h"
#include "testbed.hpp"

TEST(Libgpiod, AMissingChipIsNoDevice) {
  gpio_line_t line;
  const gpio_pin_t pin = {"44e07000", 20, false};
  EXPECT_EQ(gpio_open_output(&line, &pin, false), -ENODEV);
  EXPECT_FALSE(gpio_is_open(&line));
  EXPECT_EQ(gpio_open_input(&line, &pin), -ENODEV);
  EXPECT_EQ(gpio_open_edge(&line, &pin, GPIO_FALLING), -ENODEV);
  gpio_close(&line);
  EXPECT_EQ(line.fd, -1);
}

TEST(Libgpiod, WaitingReturnsByTheDeadlineWithoutAnEdge) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  gpio_line_t line{};
  line.fd = ends[0];
  int64_t edge_ns = 0;
  const int64_t deadline_ns = monotonic_ns() + 2000000;
  EXPECT_EQ(gpio_wait_edge(&line, deadline_ns, &edge_ns), 0);
  EXPECT_GE(monotonic_ns(), deadline_ns);
  EXPECT_EQ(gpio_wait_edge(&line, monotonic_ns() - 1000000000, &edge_ns), 0)
      << "a past deadline does not block";
  close(ends[1]);
  EXPECT_EQ(gpio_wait_edge(&line, monotonic_ns() + 1000000000, &edge_ns), -ENODEV)
      << "hung up: the chip is gone";
  close(ends[0]);
}
