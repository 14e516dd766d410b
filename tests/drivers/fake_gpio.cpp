#include "fake_gpio.hpp"

#include <errno.h>
#include <gpio.h>
#include <time.h>

#include <vector>

#include "syscall_journal.hpp"

FakeGpio& FakeGpio::instance() {
  static FakeGpio gpio;
  return gpio;
}

void FakeGpio::clear() {
  lines_.clear();
  edges_ns.clear();
  edge_error = 0;
  last_deadline_ns = 0;
}

int FakeGpio::heldLines() const {
  int held = 0;
  for (const auto& [key, line] : lines_) held += line.held ? 1 : 0;
  return held;
}

namespace {
using Entry = std::pair<const FakeGpio::Key, FakeGpio::Line>;
std::vector<const Entry*> handed_out;  // by descriptor

int request(gpio_line_t* line, const gpio_pin_t* pin, bool output, bool active) {
  *line = gpio_line_t{};
  line->fd = -1;
  FakeGpio& gpio = FakeGpio::instance();
  FakeGpio::Line& fake = gpio.line(pin->chip, pin->offset);
  if (fake.open_error != 0) return fake.open_error;
  if (fake.held) return -EBUSY;
  fake.held = true;
  fake.output = output;
  fake.active_low = pin->active_low;
  if (output) fake.active = active;
  line->open = true;
  line->fd = static_cast<int>(handed_out.size());
  handed_out.push_back(&*gpio.lines().find({pin->chip, pin->offset}));  // map nodes stay where they are
  return 0;
}

Entry& entryOf(const gpio_line_t* line) {
  return const_cast<Entry&>(*handed_out.at(static_cast<std::size_t>(line->fd)));
}
}  // namespace

extern "C" {
int gpio_open_output(gpio_line_t* line, const gpio_pin_t* pin, bool active) {
  return request(line, pin, true, active);
}

int gpio_open_input(gpio_line_t* line, const gpio_pin_t* pin) { return request(line, pin, false, false); }

int gpio_open_edge(gpio_line_t* line, const gpio_pin_t* pin, enum gpio_edge edge) {
  FakeGpio::instance().line(pin->chip, pin->offset).edge = edge;
  return request(line, pin, false, false);
}

bool gpio_is_open(const gpio_line_t* line) { return line->open; }

int gpio_set(gpio_line_t* line, bool active) {
  Entry& entry = entryOf(line);
  if (entry.second.use_error != 0) return entry.second.use_error;
  entry.second.active = active;
  SyscallJournal::instance().note(entry.first.first + ":" + std::to_string(entry.first.second) + "=" +
                                  (active ? "1" : "0"));
  return 0;
}

int gpio_get(const gpio_line_t* line) {
  const Entry& entry = entryOf(line);
  return entry.second.use_error != 0 ? entry.second.use_error : (entry.second.active ? 1 : 0);
}

int gpio_wait_edge(gpio_line_t*, int64_t deadline_ns, int64_t* edge_ns) {
  FakeGpio& gpio = FakeGpio::instance();
  gpio.last_deadline_ns = deadline_ns;
  if (gpio.edge_error != 0) return gpio.edge_error;
  const int count = static_cast<int>(gpio.edges_ns.size());
  if (count > 0) {
    *edge_ns = gpio.edges_ns.back();
    gpio.edges_ns.clear();
    return count;
  }
  const timespec deadline{static_cast<time_t>(deadline_ns / 1000000000),
                          static_cast<long>(deadline_ns % 1000000000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
  }
  return 0;
}

void gpio_close(gpio_line_t* line) {
  if (line->open) entryOf(line).second.held = false;
  *line = gpio_line_t{};
  line->fd = -1;
}
}
