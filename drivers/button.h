/* button.h: one push button on a GPIO line, debounced by counting polls: a level counts after `stable_polls`
 * equal samples. In: polls at the caller's rate. Out: pressed, and the press itself once. */
#ifndef EQUIPOISE_DRIVERS_BUTTON_H
#define EQUIPOISE_DRIVERS_BUTTON_H

#include "gpio.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct button_filter {
  unsigned stable_polls;
  unsigned seen;
  bool candidate;
  bool pressed;
} button_filter_t;

/* Pure. True exactly once per press. */
bool button_filter_update(button_filter_t* filter, bool level);

typedef struct button {
  gpio_line_t line;
  button_filter_t filter;
} button_t;

/* The pin says active low. A button that is down already counts once it has been up. */
int button_open(button_t* button, const gpio_pin_t* pin, unsigned stable_polls);
int button_poll(button_t* button, bool* was_pressed); /* *was_pressed: a new press */
void button_close(button_t* button);

#ifdef __cplusplus
}
#endif

#endif
