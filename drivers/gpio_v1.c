/* libgpiod 1 (Debian 12); CMake picks this file or gpio_v2.c. */
#include <errno.h>
#include <gpiod.h>
#include <string.h>

#include "gpio_internal.h"

static int request(gpio_line_t* line, const gpio_pin_t* pin, int type, int flags, int value) {
  memset(line, 0, sizeof *line);
  line->fd = -1;
  line->offset = pin->offset;
  char path[SYSFS_PATH_MAX];
  const int status = gpio_find_chip(pin->chip, path);
  if (status < 0) return status;
  struct gpiod_chip* chip = gpiod_chip_open(path);
  if (chip == NULL) return -errno;
  if (pin->active_low) flags |= GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW;
  const struct gpiod_line_request_config config = {
      .consumer = GPIO_CONSUMER, .request_type = type, .flags = flags};
  struct gpiod_line* requested = gpiod_chip_get_line(chip, pin->offset);
  if (requested == NULL || gpiod_line_request(requested, &config, value) < 0) {
    const int error = errno;
    gpiod_chip_close(chip);
    return -error;
  }
  line->chip = chip;
  line->request = requested;
  return 0;
}

int gpio_open_output(gpio_line_t* line, const gpio_pin_t* pin, bool active) {
  return request(line, pin, GPIOD_LINE_REQUEST_DIRECTION_OUTPUT, 0, active);
}

int gpio_open_input(gpio_line_t* line, const gpio_pin_t* pin) {
  return request(line, pin, GPIOD_LINE_REQUEST_DIRECTION_INPUT, 0, 0);
}

int gpio_open_edge(gpio_line_t* line, const gpio_pin_t* pin, enum gpio_edge edge) {
  gpio_pin_t electrical = *pin;
  electrical.active_low = false;
  const int type =
      edge == GPIO_FALLING ? GPIOD_LINE_REQUEST_EVENT_FALLING_EDGE : GPIOD_LINE_REQUEST_EVENT_RISING_EDGE;
  const int status = request(line, &electrical, type, 0, 0);
  if (status == 0) line->fd = gpiod_line_event_get_fd(line->request);
  return status;
}

int gpio_set(gpio_line_t* line, bool active) {
  return gpiod_line_set_value(line->request, active) < 0 ? -errno : 0;
}

int gpio_get(const gpio_line_t* line) {
  const int value = gpiod_line_get_value(line->request);
  return value < 0 ? -errno : value;
}

int gpio_read_edges(gpio_line_t* line, int64_t* edge_ns) {
  struct gpiod_line_event events[GPIO_EVENTS];
  const int count = gpiod_line_event_read_fd_multiple(line->fd, events, GPIO_EVENTS);
  if (count < 0) return -errno;
  if (count > 0) *edge_ns = (int64_t)events[count - 1].ts.tv_sec * 1000000000 + events[count - 1].ts.tv_nsec;
  return count;
}

void gpio_close(gpio_line_t* line) {
  if (line->chip != NULL) gpiod_chip_close(line->chip); /* releases the line */
  memset(line, 0, sizeof *line);
  line->fd = -1;
}
