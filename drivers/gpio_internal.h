/* gpio_internal.h: what gpio_v1.c and gpio_v2.c share (gpio.c), and what gpio.c needs from them. */
#ifndef EQUIPOISE_DRIVERS_GPIO_INTERNAL_H
#define EQUIPOISE_DRIVERS_GPIO_INTERNAL_H

#include "gpio.h"
#include "sysfs.h"

#define GPIO_CONSUMER "equipoise"
enum { GPIO_EVENTS = 16 }; /* the kernel queues as many */

/* /dev/gpiochipN of a label or device address. -ENODEV: none. */
int gpio_find_chip(const char* chip, char path[SYSFS_PATH_MAX]);

/* Newest of all queued edges: count, or -errno. Never blocks. */
int gpio_read_edges(gpio_line_t* line, int64_t* edge_ns);

#endif
