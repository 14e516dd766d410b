#include "led.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "sysfs.h"

int led_open(led_t* led, const char* name, const gpio_pin_t* pin) {
  memset(led, 0, sizeof *led);
  led->fd = -ENODEV;
  if (name != NULL) {
    char dir[SYSFS_PATH_MAX];
    int status = sysfs_join(dir, "/sys/class/leds", name);
    if (status < 0) return status;
    led->fd = sysfs_open(dir, "brightness", O_WRONLY);
    if (led->fd >= 0) return led_set(led, false);
  }
  return pin == NULL ? led->fd : gpio_open_output(&led->line, pin, false);
}

int led_set(led_t* led, bool on) {
  return led->fd >= 0 ? sysfs_write_u32(led->fd, on) : gpio_set(&led->line, on);
}

void led_close(led_t* led) {
  if (led->fd >= 0) {
    (void)sysfs_write_u32(led->fd, 0);
    close(led->fd);
  } else if (gpio_is_open(&led->line)) {
    (void)gpio_set(&led->line, false);
    gpio_close(&led->line);
  }
  led->fd = -1;
}
