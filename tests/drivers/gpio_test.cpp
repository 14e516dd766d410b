// drivers/gpio.c with the kernel's GPIO character device played: what it asks of it and what it makes of its
// answers. Levels and edges of real lines are tested in the virtual machine (tests/hardware).
#include <errno.h>
#include <fcntl.h>
#include <gpio.h>
#include <linux/gpio.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "monotonic.h"
#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
struct Kernel {
  int request_error = 0, use_error = 0;  // errno
  std::string chip;                      // that the line was asked of
  gpio_v2_line_request asked{};
  std::array<int, 2> ends{-1, -1};  // of the pipe that plays the line; it hands out the first
  int level = 0;
} kernel;

int failed(int error) {
  errno = error == 0 ? EBADF : error;  // a success leaves errno as it was
  return error == 0 ? 0 : -1;
}

}  // namespace

extern "C" {
int __real_ioctl(int fd, unsigned long request, ...);

int __wrap_ioctl(int fd, unsigned long request, ...) {
  va_list rest;
  va_start(rest, request);
  void* argument = va_arg(rest, void*);
  va_end(rest);
  if (request == GPIO_V2_GET_LINE_IOCTL) {
    auto& asked = *static_cast<gpio_v2_line_request*>(argument);
    kernel.chip = SyscallJournal::instance().pathOf(fd);
    kernel.asked = asked;
    if (failed(kernel.request_error) < 0) return -1;
    const gpio_v2_line_config_attribute none{};
    if (asked.config.num_attrs == 0 && std::memcmp(&asked.config.attrs[0], &none, sizeof none) != 0)
      return failed(EINVAL);
    if (asked.config.num_attrs == 1) kernel.level = static_cast<int>(asked.config.attrs[0].attr.values);
    asked.fd = fcntl(kernel.ends[0], F_DUPFD_CLOEXEC, 3);
    SyscallJournal::instance().opened(asked.fd, "line");
    return 0;
  }
  auto* values = static_cast<gpio_v2_line_values*>(argument);
  if (request == GPIO_V2_LINE_SET_VALUES_IOCTL) {
    EXPECT_EQ(values->mask, 1u);
    kernel.level = static_cast<int>(values->bits);
    return failed(kernel.use_error);
  }
  if (request == GPIO_V2_LINE_GET_VALUES_IOCTL) {
    EXPECT_EQ(values->mask, 1u);
    values->bits = static_cast<uint64_t>(kernel.level);
    return failed(kernel.use_error);
  }
  return __real_ioctl(fd, request, argument);
}
}

namespace {
class Gpio : public Testbed {
 protected:
  void SetUp() override {
    kernel = Kernel{};
    addGpioChip("44e07000", 3);
    addGpioChip("4804c000", 0);
    std::filesystem::create_directories(hostPath("/dev"));
    std::ofstream(hostPath("/dev/gpiochip3"));
    ASSERT_EQ(pipe(kernel.ends.data()), 0);
  }
  void TearDown() override {
    gpio_close(&line_);
    EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
    close(kernel.ends[0]);
    close(kernel.ends[1]);
  }
  void openEdge() { ASSERT_EQ(gpio_open_edge(&line_, &pin_, GPIO_FALLING), 0); }
  int edges(const std::vector<int64_t>& at_ns, int64_t* newest_ns) {
    for (const int64_t at : at_ns) {
      gpio_v2_line_event event{};
      event.timestamp_ns = static_cast<uint64_t>(at);
      EXPECT_EQ(write(kernel.ends[1], &event, sizeof event), static_cast<ssize_t>(sizeof event));
    }
    return gpio_wait_edge(&line_, monotonic_ns() + 1000000000, newest_ns);
  }
  const gpio_v2_line_config& asked() const { return kernel.asked.config; }

  gpio_pin_t pin_ = {"44e07000", 20, false};
  gpio_line_t line_{};
};
}  // namespace

TEST_F(Gpio, AsksTheChipAtTheAddressForTheLine) {
  ASSERT_EQ(gpio_open_output(&line_, &pin_, true), 0);
  EXPECT_EQ(kernel.chip, "/dev/gpiochip3");
  EXPECT_EQ(kernel.asked.num_lines, 1u);
  EXPECT_EQ(kernel.asked.offsets[0], 20u);
  EXPECT_STREQ(kernel.asked.consumer, "equipoise");
  EXPECT_EQ(asked().flags, GPIO_V2_LINE_FLAG_OUTPUT);
  ASSERT_EQ(asked().num_attrs, 1u);
  EXPECT_EQ(asked().attrs[0].attr.id, static_cast<uint32_t>(GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES));
  EXPECT_EQ(asked().attrs[0].mask, 1u);
  EXPECT_EQ(kernel.level, 1);
  EXPECT_TRUE(gpio_is_open(&line_));
}

TEST_F(Gpio, AnOutputMayStartLowAndActiveLowIsTheKernelsBusiness) {
  pin_.active_low = true;
  kernel.level = 1;
  ASSERT_EQ(gpio_open_output(&line_, &pin_, false), 0);
  EXPECT_EQ(kernel.level, 0);
  EXPECT_EQ(asked().flags, GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_ACTIVE_LOW);
  gpio_close(&line_);
  ASSERT_EQ(gpio_open_input(&line_, &pin_), 0);
  EXPECT_EQ(asked().flags, GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_ACTIVE_LOW);
  EXPECT_EQ(asked().num_attrs, 0u);
}

TEST_F(Gpio, AnEdgeIsElectrical) {
  pin_.active_low = true;
  openEdge();
  EXPECT_EQ(asked().flags, GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_FALLING);
  EXPECT_EQ(asked().num_attrs, 0u);
  gpio_close(&line_);
  EXPECT_EQ(line_.fd, -1);
  EXPECT_FALSE(gpio_is_open(&line_));
  ASSERT_EQ(gpio_open_edge(&line_, &pin_, GPIO_RISING), 0);
  EXPECT_EQ(asked().flags, GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING);
}

TEST_F(Gpio, AButtonIsDebouncedByTheKernel) {
  pin_.active_low = true;
  ASSERT_EQ(gpio_open_press(&line_, &pin_, 10000), 0);
  EXPECT_EQ(asked().flags,
            GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_ACTIVE_LOW);
  ASSERT_EQ(asked().num_attrs, 1u);
  EXPECT_EQ(asked().attrs[0].attr.id, static_cast<uint32_t>(GPIO_V2_LINE_ATTR_ID_DEBOUNCE));
  EXPECT_EQ(asked().attrs[0].attr.debounce_period_us, 10000u);
  EXPECT_EQ(asked().attrs[0].mask, 1u);
}

TEST_F(Gpio, PressesOfSeveralButtonsAreToldApart) {
  gpio_line_t buttons[] = {{false, -1}, {false, -1}, {false, -1}};
  const auto pressed = [&buttons](int64_t within_ns) {
    return gpio_wait_presses(buttons, 3, monotonic_ns() + within_ns);
  };
  EXPECT_EQ(pressed(2000000), 0) << "none could be opened";
  ASSERT_EQ(gpio_open_press(&buttons[2], &pin_, 10000), 0);
  EXPECT_EQ(pressed(0), 0);
  const gpio_v2_line_event event{};
  for (int i = 0; i < 2; ++i) ASSERT_EQ(write(kernel.ends[1], &event, sizeof event), ssize_t{sizeof event});
  EXPECT_EQ(pressed(1000000000), 4);
  EXPECT_EQ(pressed(0), 0) << "told once";
  close(kernel.ends[1]);
  EXPECT_EQ(pressed(1000000000), 0) << "hung up: the chip is gone";
  EXPECT_FALSE(gpio_is_open(&buttons[2])) << "the others are still waited for";
  kernel.ends[1] = dup(kernel.ends[0]);
  EXPECT_EQ(gpio_wait_presses(buttons, GPIO_MAX_PRESSES + 1, 0), -EINVAL);
}

TEST_F(Gpio, ALineThatCannotBeHadLeavesNothingOpen) {
  const auto refused = [this] {
    return gpio_open_edge(&line_, &pin_, GPIO_FALLING) == -EBUSY && line_.fd == -1 && !gpio_is_open(&line_) &&
           SyscallJournal::instance().openFiles() == 0;
  };
  SyscallJournal::instance().failOpen("/dev/gpiochip3", EBUSY);
  EXPECT_TRUE(refused());
  kernel.request_error = EBUSY;
  EXPECT_TRUE(refused());
}

TEST_F(Gpio, AMissingChipIsNoDevice) {
  const gpio_pin_t pin = {"481ac000", 20, false};
  EXPECT_EQ(gpio_open_output(&line_, &pin, false), -ENODEV);
  EXPECT_FALSE(gpio_is_open(&line_));
  EXPECT_EQ(gpio_open_input(&line_, &pin), -ENODEV);
  EXPECT_EQ(gpio_open_edge(&line_, &pin, GPIO_FALLING), -ENODEV);
  gpio_close(&line_);
  EXPECT_EQ(line_.fd, -1);
}

TEST_F(Gpio, LevelsAndTheirErrors) {
  ASSERT_EQ(gpio_open_output(&line_, &pin_, false), 0);
  EXPECT_EQ(gpio_set(&line_, true), 0);
  EXPECT_EQ(gpio_get(&line_), 1);
  EXPECT_EQ(gpio_set(&line_, false), 0);
  EXPECT_EQ(gpio_get(&line_), 0);
  kernel.use_error = ENODEV;
  EXPECT_EQ(gpio_set(&line_, true), -ENODEV);
  EXPECT_EQ(gpio_get(&line_), -ENODEV);
}

TEST_F(Gpio, SeveralEdgesAreOneAnswerWithTheNewestTime) {
  openEdge();
  const int64_t now_ns = monotonic_ns();
  int64_t edge_ns = 0;
  EXPECT_EQ(edges({now_ns - 3, now_ns - 2, now_ns - 1}, &edge_ns), 3);
  EXPECT_EQ(edge_ns, now_ns - 1);
  EXPECT_EQ(edges(std::vector<int64_t>(16, now_ns), &edge_ns), 16) << "all that the kernel queues";
  EXPECT_EQ(edges({now_ns - 900000000}, &edge_ns), 1);
  EXPECT_EQ(edge_ns, now_ns - 900000000);
}

TEST_F(Gpio, AnErrorOrNoEdgeLeavesTheTimeAlone) {
  openEdge();
  int64_t edge_ns = 42;
  EXPECT_EQ(write(kernel.ends[1], "x", 1), 1);
  EXPECT_EQ(edges({}, &edge_ns), 0) << "less than an edge";
  SyscallJournal::instance().failRead("", EIO, 1);
  EXPECT_EQ(edges({1}, &edge_ns), -EIO);
  EXPECT_EQ(edge_ns, 42);
}

TEST_F(Gpio, WaitingReturnsByTheDeadlineWithoutAnEdge) {
  openEdge();
  int64_t edge_ns = 0;
  const int64_t deadline_ns = monotonic_ns() + 2000000;
  EXPECT_EQ(gpio_wait_edge(&line_, deadline_ns, &edge_ns), 0);
  EXPECT_GE(monotonic_ns(), deadline_ns);
  EXPECT_EQ(gpio_wait_edge(&line_, monotonic_ns() - 1000000000, &edge_ns), 0)
      << "a past deadline does not block";
  close(kernel.ends[1]);
  EXPECT_EQ(gpio_wait_edge(&line_, monotonic_ns() + 1000000000, &edge_ns), -ENODEV)
      << "hung up: the chip is gone";
  kernel.ends[1] = dup(kernel.ends[0]);
}

TEST_F(Gpio, ASignalDoesNotEndTheWaitBeforeItsDeadline) {
  openEdge();
  struct sigaction ignore {};
  ignore.sa_handler = [](int) {};
  struct sigaction before {};
  ASSERT_EQ(sigaction(SIGALRM, &ignore, &before), 0);
  const itimerval soon{{0, 1000}, {0, 1000}};
  ASSERT_EQ(setitimer(ITIMER_REAL, &soon, nullptr), 0);
  int64_t edge_ns = 42;
  const int64_t deadline_ns = monotonic_ns() + 20000000;
  EXPECT_EQ(gpio_wait_edge(&line_, deadline_ns, &edge_ns), 0);
  EXPECT_GE(monotonic_ns(), deadline_ns);
  EXPECT_EQ(edge_ns, 42);
  const itimerval off{};
  setitimer(ITIMER_REAL, &off, nullptr);
  sigaction(SIGALRM, &before, nullptr);
}

TEST_F(Gpio, WaitsForMoreThanASecondIfAsked) {
  openEdge();
  int64_t edge_ns = 0;
  const int64_t deadline_ns = monotonic_ns() + 1010000000;
  EXPECT_EQ(gpio_wait_edge(&line_, deadline_ns, &edge_ns), 0);
  EXPECT_GE(monotonic_ns(), deadline_ns);
}

TEST_F(Gpio, AChipIsFoundByItsLabelToo) {
  addGpioNode("gpiochip5", "gpio-96-127");
  const gpio_pin_t pin = {"gpio-96-127", 21, false};
  ASSERT_EQ(gpio_open_input(&line_, &pin), 0);
  EXPECT_EQ(kernel.chip, "/dev/gpiochip5");
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 1) << "the line alone";
  const gpio_pin_t part = {"gpio-96", 21, false};
  gpio_close(&line_);
  EXPECT_EQ(gpio_open_input(&line_, &part), -ENODEV);
  const NoStdin none;
  EXPECT_EQ(gpio_open_input(&line_, &pin), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 1);
  gpio_close(&line_);
}
