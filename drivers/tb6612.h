/* tb6612.h: one channel of the cape's own TB6612FNG bridge, drive/brake: direction on IN1/IN2, and the motor
 * is short-circuited while the PWM is low. Both IN low: outputs float, the motor coasts. Standby is shared
 * (bbb.c). In: signed duty. Source: TB6612FNG data sheet, control table. Real-time safe. */
#ifndef EQUIPOISE_DRIVERS_TB6612_H
#define EQUIPOISE_DRIVERS_TB6612_H

#include "hbridge.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TB6612_MAX_PWM_HZ = 100000 };

typedef struct tb6612 {
  hbridge_t bridge;
} tb6612_t;

int tb6612_open(tb6612_t* motor, const hbridge_config_t* config,
                const char** culprit);          /* -EINVAL: above 100 kHz */
int tb6612_write(tb6612_t* motor, double duty); /* 0 brakes */
int tb6612_coast(tb6612_t* motor);
void tb6612_close(tb6612_t* motor); /* coasting */

#ifdef __cplusplus
}
#endif

#endif
