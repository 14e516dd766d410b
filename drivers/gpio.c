#define _GNU_SOURCE /* ppoll */
#include "gpio.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "monotonic.h"
#include "sysfs.h"

static bool has_label(const char* path, const char* label) {
  struct gpiochip_info info;
  memset(&info, 0, sizeof info);
  const int fd = open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool found =
      ioctl(fd, GPIO_GET_CHIPINFO_IOCTL, &info) == 0 && strncmp(info.label, label, sizeof info.label) == 0;
  close(fd);
  return found;
}

/* /dev/gpiochipN of a label or device address. -ENODEV: none. */
static int find_chip(const char* chip, char path[SYSFS_PATH_MAX]) {
  char dir[SYSFS_PATH_MAX];
  if (sysfs_find("/sys/bus/gpio/devices", "gpiochip", chip, dir) == 0) {
    return sysfs_join(path, "/dev", strrchr(dir, '/') + 1);
  }
  DIR* dev = opendir("/dev");
  if (dev == NULL) return -errno;
  int status = -ENODEV;
  for (const struct dirent* entry = NULL; status < 0 && (entry = readdir(dev)) != NULL;) {
    if (strncmp(entry->d_name, "gpiochip", 8) != 0) continue;
    if (sysfs_join(path, "/dev", entry->d_name) == 0 && has_label(path, chip)) status = 0;
  }
  closedir(dev);
  return status;
}

/* `attribute`: one more than `flags` of GPIO_V2_LINE_FLAG_... say, id 0: none. */
static int request(gpio_line_t* line, const gpio_pin_t* pin, uint64_t flags,
                   struct gpio_v2_line_attribute attribute) {
  line->open = false;
  line->fd = -1;
  char path[SYSFS_PATH_MAX];
  int status = find_chip(pin->chip, path);
  if (status < 0) return status;
  const int chip = open(path, O_RDWR | O_CLOEXEC);
  if (chip < 0) return -errno;
  struct gpio_v2_line_request asked;
  memset(&asked, 0, sizeof asked);
  asked.offsets[0] = pin->offset;
  asked.num_lines = 1;
  strcpy(asked.consumer, "equipoise");
  asked.config.flags = flags | (pin->active_low ? GPIO_V2_LINE_FLAG_ACTIVE_LOW : 0);
  asked.config.num_attrs = attribute.id != 0;
  asked.config.attrs[0].attr = attribute;
  asked.config.attrs[0].mask = attribute.id != 0; /* all of an unused one must be 0 */
  status = ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &asked) < 0 ? -errno : 0;
  close(chip);
  if (status < 0) return status;
  line->open = true;
  line->fd = asked.fd;
  return 0;
}

static const struct gpio_v2_line_attribute kNone;

int gpio_open_output(gpio_line_t* line, const gpio_pin_t* pin, bool active) {
  const struct gpio_v2_line_attribute first = {.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES, .values = active};
  return request(line, pin, GPIO_V2_LINE_FLAG_OUTPUT, first);
}

int gpio_open_input(gpio_line_t* line, const gpio_pin_t* pin) {
  return request(line, pin, GPIO_V2_LINE_FLAG_INPUT, kNone);
}

int gpio_open_edge(gpio_line_t* line, const gpio_pin_t* pin, enum gpio_edge edge) {
  const gpio_pin_t electrical = {.chip = pin->chip, .offset = pin->offset, .active_low = false};
  const uint64_t which =
      edge == GPIO_FALLING ? GPIO_V2_LINE_FLAG_EDGE_FALLING : GPIO_V2_LINE_FLAG_EDGE_RISING;
  return request(line, &electrical, GPIO_V2_LINE_FLAG_INPUT | which, kNone);
}

int gpio_open_press(gpio_line_t* line, const gpio_pin_t* pin, unsigned stable_us) {
  const struct gpio_v2_line_attribute stable = {.id = GPIO_V2_LINE_ATTR_ID_DEBOUNCE,
                                                .debounce_period_us = stable_us};
  return request(line, pin, GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING, stable);
}

bool gpio_is_open(const gpio_line_t* line) { return line->open; }

int gpio_set(gpio_line_t* line, bool active) {
  struct gpio_v2_line_values values = {.bits = active, .mask = 1};
  return ioctl(line->fd, GPIO_V2_LINE_SET_VALUES_IOCTL, &values) < 0 ? -errno : 0;
}

int gpio_get(const gpio_line_t* line) {
  struct gpio_v2_line_values values = {.bits = 0, .mask = 1};
  if (ioctl(line->fd, GPIO_V2_LINE_GET_VALUES_IOCTL, &values) < 0) return -errno;
  return (values.bits & 1) != 0;
}

/* Newest of all queued edges: count, or -errno. `told`: by poll(), so that it does not block. */
static int read_edges(const gpio_line_t* line, short told, int64_t* edge_ns) {
  if ((told & POLLIN) == 0) return -ENODEV;
  struct gpio_v2_line_event events[16]; /* the kernel queues as many */
  const ssize_t size = read(line->fd, events, sizeof events);
  if (size < 0) return -errno;
  const int count = (int)((size_t)size / sizeof events[0]);
  if (count > 0) *edge_ns = (int64_t)events[count - 1].timestamp_ns;
  return count;
}

/* 1, 0 at the deadline, or -errno. */
static int wait_readable(struct pollfd fds[], int count, int64_t deadline_ns) {
  for (;;) {
    int64_t left_ns = deadline_ns - monotonic_ns();
    if (left_ns < 0) left_ns = 0;
    const struct timespec timeout = {.tv_sec = (time_t)(left_ns / 1000000000),
                                     .tv_nsec = (long)(left_ns % 1000000000)};
    const int ready = ppoll(fds, (nfds_t)count, &timeout, NULL);
    if (ready >= 0) return ready > 0;
    if (errno != EINTR) return -errno;
    if (left_ns == 0) return 0;
  }
}

int gpio_wait_edge(gpio_line_t* line, int64_t deadline_ns, int64_t* edge_ns) {
  struct pollfd fd = {.fd = line->fd, .events = POLLIN, .revents = 0};
  const int ready = wait_readable(&fd, 1, deadline_ns);
  return ready <= 0 ? ready : read_edges(line, fd.revents, edge_ns);
}

int gpio_wait_presses(gpio_line_t lines[], int count, int64_t deadline_ns) {
  struct pollfd fds[GPIO_MAX_PRESSES];
  if (count > GPIO_MAX_PRESSES) return -EINVAL;
  for (int i = 0; i < count; ++i)
    fds[i] = (struct pollfd){.fd = lines[i].fd, .events = POLLIN, .revents = 0}; /* poll passes over fd -1 */
  const int ready = wait_readable(fds, count, deadline_ns);
  int pressed = 0;
  for (int i = 0; ready > 0 && i < count; ++i) {
    if (fds[i].revents == 0) continue;
    int64_t edge_ns = 0;
    const int edges = read_edges(&lines[i], fds[i].revents, &edge_ns);
    if (edges < 0) gpio_close(&lines[i]); /* which must not keep the others from being heard */
    if (edges > 0) pressed |= 1 << i;
  }
  return ready < 0 ? ready : pressed;
}

void gpio_close(gpio_line_t* line) {
  if (line->open) close(line->fd); /* releases the line */
  line->open = false;
  line->fd = -1;
}
