#include "hbridge.h"

#include <errno.h>
#include <math.h>
#include <string.h>

int hbridge_open(hbridge_t* bridge, const hbridge_config_t* config, const char** culprit) {
  memset(bridge, 0, sizeof *bridge);
  bridge->pwm.duty_fd = -1;
  bridge->reversed = config->reversed;
  const char* part = "pwm"; /* first: the motor stands still before its direction lines are driven */
  int status = pwm_open(&bridge->pwm, config->pwm, config->pwm_channel, config->period_ns);
  if (status == 0) {
    part = "in1";
    status = gpio_open_output(&bridge->in1, &config->in1, false);
  }
  if (status == 0) {
    part = "in2";
    status = gpio_open_output(&bridge->in2, &config->in2, false);
  }
  if (status < 0) hbridge_close(bridge);
  if (culprit != NULL) *culprit = status < 0 ? part : NULL;
  return status;
}

static int set_direction(hbridge_t* bridge, int direction) {
  bridge->direction = 0; /* unknown until both lines are written */
  int status = gpio_set(direction > 0 ? &bridge->in2 : &bridge->in1, false);
  if (status == 0) status = gpio_set(direction > 0 ? &bridge->in1 : &bridge->in2, true);
  if (status == 0) bridge->direction = direction;
  return status;
}

int hbridge_write(hbridge_t* bridge, double duty) {
  if (!(fabs(duty) <= 1.0)) {
    (void)hbridge_off(bridge);
    return -EINVAL;
  }
  const double signed_duty = bridge->reversed ? -duty : duty;
  const int direction = signed_duty < 0.0 ? -1 : 1;
  int status = 0;
  if (duty != 0.0 && direction != bridge->direction) {
    status = pwm_set_ns(&bridge->pwm, 0);
    if (status == 0) status = set_direction(bridge, direction);
  }
  if (status == 0) status = pwm_set_fraction(&bridge->pwm, fabs(duty));
  if (status == 0) bridge->duty = duty;
  return status;
}

static void keep_first(int* status, int next) {
  if (*status == 0) *status = next;
}

int hbridge_off(hbridge_t* bridge) {
  int status = 0;
  keep_first(&status, bridge->pwm.duty_fd < 0 ? 0 : pwm_set_ns(&bridge->pwm, 0));
  keep_first(&status, gpio_is_open(&bridge->in1) ? gpio_set(&bridge->in1, false) : 0);
  keep_first(&status, gpio_is_open(&bridge->in2) ? gpio_set(&bridge->in2, false) : 0);
  bridge->direction = 0;
  bridge->duty = 0.0;
  return status;
}

void hbridge_close(hbridge_t* bridge) {
  (void)hbridge_off(bridge);
  pwm_close(&bridge->pwm);
  gpio_close(&bridge->in1);
  gpio_close(&bridge->in2);
}
