/* sample.h: what the hardware boundary delivers and takes, in C: device counts in, signed duties out. The
 * tick's RawSample and MotorCommand are these structs. Doubles, so that a simulated device can be exact or
 * deliver a NaN. A zeroed struct is "nothing valid" and "motors off". */
#ifndef EQUIPOISE_SAMPLE_H
#define EQUIPOISE_SAMPLE_H

#include <stdbool.h>
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

#ifdef __cplusplus
}
#endif

#endif
