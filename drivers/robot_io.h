/* robot_io.h: the hardware boundary. A backend (board, mock, plant, lockstep socket, fault injector) is a
 * table of function pointers; the loop calls nothing else. In: device counts, straight from the chips, as
 * double so that a simulated device can be exact or deliver a NaN. Out: signed duty per motor. Every call
 * returns 0 or -errno. Real-time safe apart from close(), as far as the backend is. */
#ifndef EQUIPOISE_DRIVERS_ROBOT_IO_H
#define EQUIPOISE_DRIVERS_ROBOT_IO_H

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { RIO_MAX_MOTORS = 4 };

/* What of a sample is fresh and plausible; a clear bit means "do not use". */
enum rio_valid {
  RIO_IMU = 1u << 0,
  RIO_ENCODERS = 1u << 1,
  RIO_BATTERY = 1u << 2,
  RIO_ATTITUDE = 1u << 3, /* a new attitude packet (DMP) since the last sample */
};

/* Why a bit is clear, or what was noticed; recorded, never acted on by a driver. */
enum rio_health {
  RIO_IMU_CLIPPED = 1u << 0,
  RIO_IMU_STUCK = 1u << 1,
  RIO_IMU_LATE = 1u << 2,
  RIO_IMU_BUS_ERROR = 1u << 3,
  RIO_DMP_OVERFLOW = 1u << 4,
  RIO_DMP_BAD_PACKET = 1u << 5,
  RIO_ENCODER_ERROR = 1u << 6,
  RIO_BRIDGE_FAULT = 1u << 7,
  RIO_BATTERY_ERROR = 1u << 8,
};

typedef struct rio_sensors {
  int64_t t_ns;                          /* CLOCK_MONOTONIC at the IMU's data-ready edge */
  double gyro_counts[3];                 /* sensor axes, 16.4 counts per deg/s at +-2000 deg/s */
  double accel_counts[3];                /* sensor axes, specific force, 4096 counts per g at +-8 g */
  double encoder_counts[RIO_MAX_MOTORS]; /* unwrapped, motor order */
  double battery_counts;                 /* ADC counts */
  double imu_temperature_degC;           /* of the chip; 0 where unknown */
  double attitude_wxyz[4];               /* unit quaternion R_WS of the attitude source */
  uint32_t valid;                        /* enum rio_valid */
  uint32_t health;                       /* enum rio_health */
} rio_sensors_t;

typedef struct rio_motors {
  double duty[RIO_MAX_MOTORS]; /* -1 .. 1, sign = direction, motor order */
  bool enable;                 /* false: bridges asleep, motors coast, duty ignored */
} rio_motors_t;

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
