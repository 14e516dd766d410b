/* cutoff.h: the hands of a guard process: it can stop the motors of a robot whose own process is dead or
 * hangs. The kernel keeps the last PWM on-time when a process dies, so someone else must zero it. In: the
 * same wiring as bbb_open, with enable_held_elsewhere set there. off() is real-time safe and tries
 * everything. */
#ifndef EQUIPOISE_DRIVERS_CUTOFF_H
#define EQUIPOISE_DRIVERS_CUTOFF_H

#include "bbb_config.h"
#include "gpio.h"
#include "pwm.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cutoff {
  pwm_t pwm[RIO_MAX_MOTORS];
  uint32_t motors;
  gpio_line_t enable;
} cutoff_t;

/* Before the robot's own process opens the board. Exports the PWM channels (and so keeps them), holds the
 * enable line, all off. */
int cutoff_open(cutoff_t* cutoff, const bbb_config_t* config, bbb_error_t* error);
int cutoff_enable(cutoff_t* cutoff); /* bridges awake: the robot's process may drive */
int cutoff_off(cutoff_t* cutoff);    /* bridges asleep, every on-time 0; the first error, after trying all */
void cutoff_close(cutoff_t* cutoff);

#ifdef __cplusplus
}
#endif

#endif
