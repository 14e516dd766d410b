/* hbridge.h: two direction lines and a PWM: what both motor bridges have in common. In: signed duty. The
 * direction never changes under power: the duty goes through 0. Real-time safe: one to four system calls. */
#ifndef EQUIPOISE_DRIVERS_HBRIDGE_H
#define EQUIPOISE_DRIVERS_HBRIDGE_H

#include "gpio.h"
#include "pwm.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct hbridge_config {
  gpio_pin_t in1; /* IN1 high, IN2 low: forward */
  gpio_pin_t in2;
  const char* pwm; /* module address */
  unsigned pwm_channel;
  uint32_t period_ns;
  bool reversed; /* motor leads swapped */
} hbridge_config_t;

typedef struct hbridge {
  gpio_line_t in1;
  gpio_line_t in2;
  pwm_t pwm;
  bool reversed;
  int direction; /* +1, -1; 0: both lines low */
  double duty;   /* as last written */
} hbridge_t;

/* `culprit` (may be NULL) becomes the name of the part that failed: "in1", "in2" or "pwm". */
int hbridge_open(hbridge_t* bridge, const hbridge_config_t* config, const char** culprit);
int hbridge_write(hbridge_t* bridge, double duty); /* -1 .. 1; -EINVAL otherwise, and the bridge is off */
int hbridge_off(hbridge_t* bridge);                /* tries all of it, returns the first error */
void hbridge_close(hbridge_t* bridge);

#ifdef __cplusplus
}
#endif

#endif
