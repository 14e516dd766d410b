// drivers/gpio.c and gpio_v1.c with libgpiod 1 played: what they ask of it and what they make of its answers.
// Levels and edges of real lines are tested in the virtual machine (tests/hardware).
#include <errno.h>
#include <fcntl.h>
#include <gpio.h>
#include <gpiod.h>
#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "monotonic.h"
#include "syscall_journal.hpp"
#include "testbed.hpp"

struct gpiod_chip {
  std::string path;
};
struct gpiod_line {
  unsigned offset;
};

namespace {
struct Gpiod {
  int open_error = 0, line_error = 0, request_error = 0, use_error = 0;  // errno
  int open_chips = 0;
  int level = 0;
  int event_fd = -1;
  std::vector<int64_t> edges_ns;
  gpiod_chip chip;
  gpiod_line line{};
  gpiod_line_request_config asked{};
  int first_level = -1;
} gpiod;

/// A success leaves errno as it was.
int failed(int error) {
  errno = error == 0 ? EBADF : error;
  return error == 0 ? 0 : -1;
}
}  // namespace

extern "C" {
gpiod_chip* gpiod_chip_open(const char* path) {
  if (failed(gpiod.open_error) < 0) return nullptr;
  ++gpiod.open_chips;
  gpiod.chip.path = path;
  return &gpiod.chip;
}
void gpiod_chip_close(gpiod_chip*) {
  --gpiod.open_chips;
  errno = 0;
}
gpiod_line* gpiod_chip_get_line(gpiod_chip*, unsigned offset) {
  gpiod.line.offset = offset;
  return failed(gpiod.line_error) < 0 ? nullptr : &gpiod.line;
}
int gpiod_line_request(gpiod_line*, const gpiod_line_request_config* config, int value) {
  gpiod.asked = *config;
  gpiod.first_level = value;
  return failed(gpiod.request_error);
}
int gpiod_line_event_get_fd(gpiod_line*) { return gpiod.event_fd; }
int gpiod_line_set_value(gpiod_line*, int value) {
  gpiod.level = value;
  return failed(gpiod.use_error);
}
int gpiod_line_get_value(gpiod_line*) { return failed(gpiod.use_error) < 0 ? -1 : gpiod.level; }
int gpiod_line_event_read_fd_multiple(int fd, gpiod_line_event* events, unsigned room) {
  char byte;
  if (failed(gpiod.use_error) < 0 || read(fd, &byte, 1) != 1) return -1;
  unsigned count = 0;
  for (; count < room && count < gpiod.edges_ns.size(); ++count) {
    events[count].ts = {static_cast<time_t>(gpiod.edges_ns[count] / 1000000000),
                        static_cast<long>(gpiod.edges_ns[count] % 1000000000)};
  }
  return static_cast<int>(count);
}
}

namespace {
class GpioV1 : public Testbed {
 protected:
  void SetUp() override {
    gpiod = Gpiod{};
    addGpioChip("44e07000", 3);
    addGpioChip("4804c000", 0);
    ASSERT_EQ(pipe(events_), 0);
    gpiod.event_fd = events_[0];
  }
  void TearDown() override {
    gpio_close(&line_);
    EXPECT_EQ(gpiod.open_chips, 0);
    close(events_[0]);
    close(events_[1]);
  }
  void openEdge() { ASSERT_EQ(gpio_open_edge(&line_, &pin_, GPIO_FALLING), 0); }
  int edges(const std::vector<int64_t>& at_ns, int64_t* newest_ns) {
    gpiod.edges_ns = at_ns;
    EXPECT_EQ(write(events_[1], "x", 1), 1);
    return gpio_wait_edge(&line_, monotonic_ns() + 1000000000, newest_ns);
  }

  gpio_pin_t pin_ = {"44e07000", 20, false};
  gpio_line_t line_{};
  int events_[2];
};
}  // namespace

TEST_F(GpioV1, AsksTheChipAtTheAddressForTheLine) {
  ASSERT_EQ(gpio_open_output(&line_, &pin_, true), 0);
  EXPECT_EQ(gpiod.chip.path, "/dev/gpiochip3");
  EXPECT_EQ(gpiod.line.offset, 20u);
  EXPECT_EQ(line_.offset, 20u);
  EXPECT_STREQ(gpiod.asked.consumer, "equipoise");
  EXPECT_EQ(gpiod.asked.request_type, GPIOD_LINE_REQUEST_DIRECTION_OUTPUT);
  EXPECT_EQ(gpiod.asked.flags, 0);
  EXPECT_EQ(gpiod.first_level, 1);
  EXPECT_TRUE(gpio_is_open(&line_));
  EXPECT_EQ(line_.fd, -1) << "only an edge line has one";
}

TEST_F(GpioV1, AnOutputMayStartLowAndActiveLowIsTheLibrarysBusiness) {
  pin_.active_low = true;
  ASSERT_EQ(gpio_open_output(&line_, &pin_, false), 0);
  EXPECT_EQ(gpiod.first_level, 0);
  EXPECT_EQ(gpiod.asked.flags, GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW);
  gpio_close(&line_);
  ASSERT_EQ(gpio_open_input(&line_, &pin_), 0);
  EXPECT_EQ(gpiod.asked.request_type, GPIOD_LINE_REQUEST_DIRECTION_INPUT);
  EXPECT_EQ(gpiod.asked.flags, GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW);
  EXPECT_EQ(gpiod.first_level, 0);
}

TEST_F(GpioV1, AnEdgeIsElectrical) {
  pin_.active_low = true;
  openEdge();
  EXPECT_EQ(gpiod.asked.request_type, GPIOD_LINE_REQUEST_EVENT_FALLING_EDGE);
  EXPECT_EQ(gpiod.asked.flags, 0);
  EXPECT_EQ(gpiod.first_level, 0);
  EXPECT_EQ(line_.fd, events_[0]);
  gpio_close(&line_);
  EXPECT_EQ(line_.fd, -1);
  EXPECT_FALSE(gpio_is_open(&line_));
  ASSERT_EQ(gpio_open_edge(&line_, &pin_, GPIO_RISING), 0);
  EXPECT_EQ(gpiod.asked.request_type, GPIOD_LINE_REQUEST_EVENT_RISING_EDGE);
}

TEST_F(GpioV1, ALineThatCannotBeHadLeavesNothingOpen) {
  const auto refused = [this](int* error) {
    *error = EBUSY;
    const int status = gpio_open_edge(&line_, &pin_, GPIO_FALLING);
    *error = 0;
    return status == -EBUSY && gpiod.open_chips == 0 && line_.fd == -1 && !gpio_is_open(&line_);
  };
  EXPECT_TRUE(refused(&gpiod.open_error));
  EXPECT_TRUE(refused(&gpiod.line_error));
  EXPECT_TRUE(refused(&gpiod.request_error));
}

TEST_F(GpioV1, LevelsAndTheirErrors) {
  ASSERT_EQ(gpio_open_output(&line_, &pin_, false), 0);
  EXPECT_EQ(gpio_set(&line_, true), 0);
  EXPECT_EQ(gpio_get(&line_), 1);
  EXPECT_EQ(gpio_set(&line_, false), 0);
  EXPECT_EQ(gpio_get(&line_), 0);
  gpiod.use_error = ENODEV;
  EXPECT_EQ(gpio_set(&line_, true), -ENODEV);
  EXPECT_EQ(gpio_get(&line_), -ENODEV);
}

TEST_F(GpioV1, SeveralEdgesAreOneAnswerWithTheNewestTime) {
  openEdge();
  const int64_t now_ns = monotonic_ns();
  int64_t edge_ns = 0;
  EXPECT_EQ(edges({now_ns - 3, now_ns - 2, now_ns - 1}, &edge_ns), 3);
  EXPECT_EQ(edge_ns, now_ns - 1);
  EXPECT_EQ(edges(std::vector<int64_t>(16, now_ns), &edge_ns), 16) << "all that the kernel queues";
  EXPECT_EQ(edges({now_ns - 900000000}, &edge_ns), 1);
  EXPECT_EQ(edge_ns, now_ns - 900000000);
}

TEST_F(GpioV1, AStampOfAnotherClockIsReplacedByTheWakeUp) {
  openEdge();
  const int64_t before_ns = monotonic_ns();
  for (const int64_t strange_ns : {before_ns + 3600000000000, before_ns - 1100000000}) {
    int64_t edge_ns = 0;
    EXPECT_EQ(edges({strange_ns}, &edge_ns), 1);
    EXPECT_GE(edge_ns, before_ns);
    EXPECT_LE(edge_ns, monotonic_ns());
  }
}

TEST_F(GpioV1, AnErrorOrNoEdgeLeavesTheTimeAlone) {
  openEdge();
  int64_t edge_ns = 42;
  EXPECT_EQ(edges({}, &edge_ns), 0);
  gpiod.use_error = EIO;
  EXPECT_EQ(edges({1}, &edge_ns), -EIO);
  EXPECT_EQ(edge_ns, 42);
}

TEST_F(GpioV1, ASignalDoesNotEndTheWaitBeforeItsDeadline) {
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

TEST_F(GpioV1, WaitsForMoreThanASecondIfAsked) {
  openEdge();
  int64_t edge_ns = 0;
  const int64_t deadline_ns = monotonic_ns() + 1010000000;
  EXPECT_EQ(gpio_wait_edge(&line_, deadline_ns, &edge_ns), 0);
  EXPECT_GE(monotonic_ns(), deadline_ns);
}

TEST_F(GpioV1, AChipIsFoundByItsLabelToo) {
  addGpioNode("gpiochip5", "gpio-96-127");
  const gpio_pin_t pin = {"gpio-96-127", 21, false};
  ASSERT_EQ(gpio_open_input(&line_, &pin), 0);
  EXPECT_EQ(gpiod.chip.path, "/dev/gpiochip5");
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  const gpio_pin_t part = {"gpio-96", 21, false};
  gpio_close(&line_);
  EXPECT_EQ(gpio_open_input(&line_, &part), -ENODEV);
  const NoStdin none;
  EXPECT_EQ(gpio_open_input(&line_, &pin), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
}
