/* pwm.h: one channel of an EHRPWM module through sysfs, by the module's address and never its number.
 * In: period once, then on-time. Out: 0 or -errno. set() is real-time safe: one system call on a kept
 * descriptor. The on-time is 0 whenever the channel is opened, enabled or closed. */
#ifndef EQUIPOISE_DRIVERS_PWM_H
#define EQUIPOISE_DRIVERS_PWM_H

#include <stdbool.h>
#include <stdint.h>

#include "sysfs.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct pwm {
  int duty_fd;
  uint32_t period_ns;
  unsigned channel;
  bool exported_here; /* whoever exports a channel unexports it */
  char chip_dir[SYSFS_PATH_MAX];
  char dir[SYSFS_PATH_MAX];
} pwm_t;

/* `device`: "48302200". Both channels of a module share one period: -EINVAL if the other one runs at another.
 * -ENODEV: no such module. Leaves the channel enabled at zero on-time. */
int pwm_open(pwm_t* pwm, const char* device, unsigned channel, uint32_t period_ns);
int pwm_set_ns(pwm_t* pwm, uint32_t on_ns);        /* -EINVAL above the period */
int pwm_set_fraction(pwm_t* pwm, double fraction); /* 0 .. 1 */
void pwm_close(pwm_t* pwm);

#ifdef __cplusplus
}
#endif

#endif
