/* gpio.h: single lines through the kernel's GPIO character device, version 2 (Linux 5.10).
 * In: the chip's label or device address ("44e07000", never its number: it changes with the kernel) and the
 * line. Out: levels, edges with their CLOCK_MONOTONIC time; 0 or -errno (-EBUSY: someone else holds the
 * line). get, set and wait_edge are real-time safe; waiting always ends by its deadline. */
#ifndef EQUIPOISE_DRIVERS_GPIO_H
#define EQUIPOISE_DRIVERS_GPIO_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gpio_pin {
  const char* chip;
  unsigned offset;
  bool active_low;
} gpio_pin_t;

typedef struct gpio_line {
  bool open; /* all zero: no line */
  int fd;
} gpio_line_t;

enum gpio_edge { GPIO_FALLING, GPIO_RISING };
enum { GPIO_MAX_PRESSES = 4 };

int gpio_open_output(gpio_line_t* line, const gpio_pin_t* pin, bool active);
int gpio_open_input(gpio_line_t* line, const gpio_pin_t* pin);
int gpio_open_edge(gpio_line_t* line, const gpio_pin_t* pin, enum gpio_edge edge); /* electrical edge */
/* A button, debounced for `stable_us`; one that is down already counts once it was up. */
int gpio_open_press(gpio_line_t* line, const gpio_pin_t* pin, unsigned stable_us);
bool gpio_is_open(const gpio_line_t* line);

int gpio_set(gpio_line_t* line, bool active);
int gpio_get(const gpio_line_t* line); /* 0 or 1, or -errno */

/* Waits for an edge until `deadline_ns`. Returns how many there were, 0 at the deadline, or -errno; *edge_ns
 * is the newest one's time. */
int gpio_wait_edge(gpio_line_t* line, int64_t deadline_ns, int64_t* edge_ns);
/* Waits for presses until `deadline_ns`: bit i is lines[i], at most GPIO_MAX_PRESSES; 0 at the deadline, or
 * -errno. A line that fails is closed, one that is closed (fd -1) never pressed. */
int gpio_wait_presses(gpio_line_t lines[], int count, int64_t deadline_ns);

void gpio_close(gpio_line_t* line); /* an output keeps its level or floats, as the chip likes: set it first */

#ifdef __cplusplus
}
#endif

#endif
