/* libgpiod 2 (Debian 13); CMake picks this file or gpio_v1.c. */
#include <errno.h>
#include <gpiod.h>
#include <string.h>

#include "gpio_internal.h"

static struct gpiod_line_request* request_line(struct gpiod_chip* chip, unsigned offset,
                                               struct gpiod_line_settings* settings) {
  struct gpiod_line_config* lines = gpiod_line_config_new();
  struct gpiod_request_config* owner = gpiod_request_config_new();
  struct gpiod_line_request* requested = NULL;
  if (lines != NULL && owner != NULL &&
      gpiod_line_config_add_line_settings(lines, &offset, 1, settings) == 0) {
    gpiod_request_config_set_consumer(owner, GPIO_CONSUMER);
    requested = gpiod_chip_request_lines(chip, owner, lines);
  }
  const int error = errno;
  gpiod_request_config_free(owner);
  gpiod_line_config_free(lines);
  errno = error;
  return requested;
}

static int request(gpio_line_t* line, const gpio_pin_t* pin, struct gpiod_line_settings* settings) {
  memset(line, 0, sizeof *line);
  line->fd = -1;
  line->offset = pin->offset;
  char path[SYSFS_PATH_MAX];
  const int status = gpio_find_chip(pin->chip, path);
  if (status < 0) return status;
  struct gpiod_chip* chip = gpiod_chip_open(path);
  if (chip == NULL) return -errno;
  line->request = request_line(chip, pin->offset, settings);
  if (line->request == NULL) {
    const int error = errno;
    gpiod_chip_close(chip);
    return -error;
  }
  line->chip = chip;
  return 0;
}

int gpio_open_output(gpio_line_t* line, const gpio_pin_t* pin, bool active) {
  struct gpiod_line_settings* settings = gpiod_line_settings_new();
  if (settings == NULL) return -ENOMEM;
  gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_OUTPUT);
  gpiod_line_settings_set_active_low(settings, pin->active_low);
  gpiod_line_settings_set_output_value(settings,
                                       active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE);
  const int status = request(line, pin, settings);
  gpiod_line_settings_free(settings);
  return status;
}

int gpio_open_input(gpio_line_t* line, const gpio_pin_t* pin) {
  struct gpiod_line_settings* settings = gpiod_line_settings_new();
  if (settings == NULL) return -ENOMEM;
  gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_INPUT);
  gpiod_line_settings_set_active_low(settings, pin->active_low);
  const int status = request(line, pin, settings);
  gpiod_line_settings_free(settings);
  return status;
}

int gpio_open_edge(gpio_line_t* line, const gpio_pin_t* pin, enum gpio_edge edge) {
  struct gpiod_line_settings* settings = gpiod_line_settings_new();
  if (settings == NULL) return -ENOMEM;
  gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_INPUT);
  gpiod_line_settings_set_edge_detection(
      settings, edge == GPIO_FALLING ? GPIOD_LINE_EDGE_FALLING : GPIOD_LINE_EDGE_RISING);
  gpiod_line_settings_set_event_clock(settings, GPIOD_LINE_CLOCK_MONOTONIC);
  int status = request(line, pin, settings);
  gpiod_line_settings_free(settings);
  if (status < 0) return status;
  line->fd = gpiod_line_request_get_fd(line->request);
  line->events = gpiod_edge_event_buffer_new(GPIO_EVENTS);
  if (line->events == NULL) {
    gpio_close(line);
    status = -ENOMEM;
  }
  return status;
}

int gpio_set(gpio_line_t* line, bool active) {
  const enum gpiod_line_value value = active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
  return gpiod_line_request_set_value(line->request, line->offset, value) < 0 ? -errno : 0;
}

int gpio_get(const gpio_line_t* line) {
  const enum gpiod_line_value value = gpiod_line_request_get_value(line->request, line->offset);
  if (value == GPIOD_LINE_VALUE_ERROR) return -errno;
  return value == GPIOD_LINE_VALUE_ACTIVE ? 1 : 0;
}

int gpio_read_edges(gpio_line_t* line, int64_t* edge_ns) {
  const int count = gpiod_line_request_read_edge_events(line->request, line->events, GPIO_EVENTS);
  if (count < 0) return -errno;
  if (count > 0) {
    struct gpiod_edge_event* newest =
        gpiod_edge_event_buffer_get_event(line->events, (unsigned long)(count - 1));
    *edge_ns = (int64_t)gpiod_edge_event_get_timestamp_ns(newest);
  }
  return count;
}

void gpio_close(gpio_line_t* line) {
  if (line->events != NULL) gpiod_edge_event_buffer_free(line->events);
  if (line->request != NULL) gpiod_line_request_release(line->request);
  if (line->chip != NULL) gpiod_chip_close(line->chip);
  memset(line, 0, sizeof *line);
  line->fd = -1;
}
