/* mpu9250.h: InvenSense MPU-9250 (and its relatives MPU-9255, MPU-6500) as a raw 6-axis sensor on I2C.
 * In: /dev/i2c-N, ranges, rate. Out: counts in sensor axes, big-endian bytes already turned, and health
 * flags. Source: MPU-9250 register map RM-MPU-9250A. read() is real-time safe: one I2C transfer. */
#ifndef EQUIPOISE_DRIVERS_MPU9250_H
#define EQUIPOISE_DRIVERS_MPU9250_H

#include <stdbool.h>
#include <stdint.h>

#include "i2c_dev.h"
#include "repeats.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct mpu9250_config {
  const char* bus;
  uint16_t address;        /* 0x68, or 0x69 with AD0 high */
  uint16_t rate_hz;        /* 4 .. 1000, a divisor of 1000 */
  uint16_t gyro_range_dps; /* 250, 500, 1000, 2000 */
  uint16_t accel_range_g;  /* 2, 4, 8, 16 */
  uint8_t dlpf;            /* 1 .. 6: 184, 92, 41, 20, 10, 5 Hz */
  uint16_t stuck_after;    /* identical samples in a row that mean "stuck"; 0: never */
  bool interrupt_active_low;
} mpu9250_config_t;

enum mpu9250_flags {
  MPU9250_CLIPPED = 1u << 0, /* an axis is at the end of its range */
  MPU9250_STUCK = 1u << 1,   /* a live sensor has noise; this one repeats itself */
};

typedef struct mpu9250_sample {
  int16_t accel[3];
  int16_t gyro[3];
  int16_t temperature; /* 333.87 counts per K, 0 = 21 degC */
  uint32_t flags;
} mpu9250_sample_t;

typedef struct mpu9250 {
  i2c_dev_t i2c;
  uint8_t who_am_i;
  bool variant; /* works, but is not an MPU-9250: warn */
  repeats_t repeats;
} mpu9250_t;

/* Resets and configures the chip, reads every register back. -ENODEV: another chip answers; -EINVAL: bad
 * config; -EIO: a register did not keep its value. Takes about 0.2 s. */
int mpu9250_open(mpu9250_t* imu, const mpu9250_config_t* config);
int mpu9250_read(mpu9250_t* imu, mpu9250_sample_t* out);
void mpu9250_close(mpu9250_t* imu); /* interrupts off, chip asleep */

#ifdef __cplusplus
}
#endif

#endif
