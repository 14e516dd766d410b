#include "cutoff.h"

#include <string.h>

#include "bbb_error.h"

int cutoff_open(cutoff_t* cutoff, const bbb_config_t* config, bbb_error_t* error) {
  memset(cutoff, 0, sizeof *cutoff);
  if (config->motors < 1 || config->motors > RIO_MAX_MOTORS || config->pwm_hz == 0) {
    return bbb_fail(error, -EINVAL, "guard", "motors or pwm_hz");
  }
  int status = 0;
  if (config->enable.used) {
    const gpio_pin_t pin = {
        .chip = config->enable.chip, .offset = config->enable.line, .active_low = config->enable.active_low};
    status = gpio_open_output(&cutoff->enable, &pin, false);
    if (status < 0) return bbb_fail(error, status, "guard: bridge enable line of chip", config->enable.chip);
  }
  for (uint32_t i = 0; status == 0 && i < config->motors; ++i) {
    const bbb_motor_t* motor = &config->motor[i];
    status = pwm_open(&cutoff->pwm[i], motor->pwm, motor->pwm_channel, 1000000000u / config->pwm_hz);
    if (status < 0) {
      (void)bbb_fail(error, status, "guard: pwm", motor->pwm);
    } else {
      cutoff->motors = i + 1;
    }
  }
  if (status < 0) cutoff_close(cutoff);
  return status;
}

int cutoff_enable(cutoff_t* cutoff) {
  return gpio_is_open(&cutoff->enable) ? gpio_set(&cutoff->enable, true) : 0;
}

int cutoff_off(cutoff_t* cutoff) {
  int status = gpio_is_open(&cutoff->enable) ? gpio_set(&cutoff->enable, false) : 0;
  for (uint32_t i = 0; i < cutoff->motors; ++i) {
    const int next = pwm_set_ns(&cutoff->pwm[i], 0);
    if (status == 0) status = next;
  }
  return status;
}

void cutoff_close(cutoff_t* cutoff) {
  (void)cutoff_off(cutoff);
  for (uint32_t i = 0; i < cutoff->motors; ++i) pwm_close(&cutoff->pwm[i]);
  if (gpio_is_open(&cutoff->enable)) gpio_close(&cutoff->enable);
  cutoff->motors = 0;
}
