/* events.h: an event device of Linux (gamepad, keyboard; /dev/input/...), never blocking. In: its path. Out:
 * events as they come, ranges of axes, or -errno: -EAGAIN nothing there, -ENODEV it is gone. A pipe with the
 * same records serves, too, but knows no ranges (-ENOTTY). */
#ifndef EQUIPOISE_DRIVERS_EVENTS_H
#define EQUIPOISE_DRIVERS_EVENTS_H

#include <linux/input.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct events {
  int fd;
} events_t;

int events_open(events_t* events, const char* path);
int events_next(const events_t* events, struct input_event* out); /* 0: *out is the next */
int events_axis(const events_t* events, uint16_t code, struct input_absinfo* out);
int events_wait(const events_t* events, int milliseconds); /* 1: something is there; 0: not yet */
void events_close(events_t* events);

#ifdef __cplusplus
}
#endif

#endif
