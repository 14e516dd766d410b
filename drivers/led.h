/* led.h: one LED: by its kernel name (/sys/class/leds/NAME) where the device tree owns it, else as a GPIO
 * line. set() is one system call. */
#ifndef EQUIPOISE_DRIVERS_LED_H
#define EQUIPOISE_DRIVERS_LED_H

#include "gpio.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct led {
  int fd; /* brightness, or -1 */
  gpio_line_t line;
} led_t;

/* `name` or `pin` may be NULL; the name is tried first. The LED starts dark. */
int led_open(led_t* led, const char* name, const gpio_pin_t* pin);
int led_set(led_t* led, bool on);
void led_close(led_t* led); /* dark */

#ifdef __cplusplus
}
#endif

#endif
