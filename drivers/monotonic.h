/* monotonic.h: CLOCK_MONOTONIC in ns, and a sleep for opening devices. monotonic_ns() is real-time safe
 * (vDSO). */
#ifndef EQUIPOISE_DRIVERS_MONOTONIC_H
#define EQUIPOISE_DRIVERS_MONOTONIC_H

#include <errno.h>
#include <stdint.h>
#include <time.h>

static inline int64_t monotonic_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Not for the loop. */
static inline void sleep_ms(int64_t duration_ms) {
  struct timespec left = {.tv_sec = (time_t)(duration_ms / 1000),
                          .tv_nsec = (long)(duration_ms % 1000) * 1000000};
  while (nanosleep(&left, &left) != 0 && errno == EINTR) {
  }
}

#endif
