#include "button.h"

#include <string.h>

bool button_filter_update(button_filter_t* filter, bool level) {
  if (level != filter->candidate) {
    filter->candidate = level;
    filter->seen = 0;
  }
  if (filter->seen < filter->stable_polls) ++filter->seen;
  if (filter->seen < filter->stable_polls || level == filter->pressed) return false;
  filter->pressed = level;
  return level;
}

int button_open(button_t* button, const gpio_pin_t* pin, unsigned stable_polls) {
  memset(button, 0, sizeof *button);
  button->filter.stable_polls = stable_polls;
  int status = gpio_open_input(&button->line, pin);
  if (status < 0) return status;
  status = gpio_get(&button->line);
  if (status < 0) {
    button_close(button);
    return status;
  }
  button->filter.candidate = button->filter.pressed = status == 1; /* held since before: no press */
  return 0;
}

int button_poll(button_t* button, bool* was_pressed) {
  *was_pressed = false;
  const int level = gpio_get(&button->line);
  if (level < 0) return level;
  *was_pressed = button_filter_update(&button->filter, level == 1);
  return 0;
}

void button_close(button_t* button) { gpio_close(&button->line); }
