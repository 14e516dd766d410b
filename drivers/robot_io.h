/* robot_io.h: the hardware boundary. A backend (board, mock, plant, lockstep socket, fault injector) is a
 * table of function pointers; the loop calls nothing else. In: device counts, out: duties, see
 * equipoise/sample.h. Every call returns 0 or -errno. Real-time safe apart from close(), as far as the
 * backend is. */
#ifndef EQUIPOISE_DRIVERS_ROBOT_IO_H
#define EQUIPOISE_DRIVERS_ROBOT_IO_H

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "equipoise/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct rio_ops {
  int (*wait_tick)(void* self, int64_t* now_ns); /* blocks until the next tick; -ESHUTDOWN: no more ticks */
  int (*read_sensors)(void* self, rio_sensors_t* out);
  int (*write_motors)(void* self, const rio_motors_t* command);
  int (*motors_off)(void* self); /* must succeed from any state */
  void (*close)(void* self);     /* motors off, then release */
} rio_ops_t;

typedef struct rio {
  const rio_ops_t* ops;
  void* self;
} rio_t;

static inline int rio_wait_tick(const rio_t* io, int64_t* now_ns) {
  return io->ops->wait_tick(io->self, now_ns);
}

static inline int rio_read_sensors(const rio_t* io, rio_sensors_t* out) {
  return io->ops->read_sensors(io->self, out);
}

static inline int rio_motors_off(const rio_t* io) { return io->ops->motors_off(io->self); }

/* The last door before the motors: anything but a finite duty within +-1 turns them off and is an error. */
static inline int rio_write_motors(const rio_t* io, const rio_motors_t* command) {
  for (int i = 0; i < RIO_MAX_MOTORS; ++i) {
    if (!isfinite(command->duty[i]) || fabs(command->duty[i]) > 1.0) {
      (void)io->ops->motors_off(io->self);
      return -EINVAL;
    }
  }
  return io->ops->write_motors(io->self, command);
}

static inline void rio_close(rio_t* io) {
  if (io->ops != NULL) io->ops->close(io->self);
  io->ops = NULL;
  io->self = NULL;
}

#ifdef __cplusplus
}
#endif

#endif
