#include "tb6612.h"

#include <errno.h>
#include <string.h>

int tb6612_open(tb6612_t* motor, const hbridge_config_t* config, const char** culprit) {
  memset(motor, 0, sizeof *motor);
  if (culprit != NULL) *culprit = "pwm";
  if (config->period_ns < 1000000000u / TB6612_MAX_PWM_HZ) return -EINVAL;
  return hbridge_open(&motor->bridge, config, culprit);
}

int tb6612_write(tb6612_t* motor, double duty) { return hbridge_write(&motor->bridge, duty); }

int tb6612_coast(tb6612_t* motor) { return hbridge_off(&motor->bridge); }

void tb6612_close(tb6612_t* motor) { hbridge_close(&motor->bridge); }
