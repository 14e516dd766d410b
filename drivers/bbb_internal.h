/* bbb_internal.h: the state of an open board, shared by bbb.c (the tick) and bbb_open.c (opening). */
#ifndef EQUIPOISE_DRIVERS_BBB_INTERNAL_H
#define EQUIPOISE_DRIVERS_BBB_INTERNAL_H

#include "adc.h"
#include "bbb.h"
#include "dmp.h"
#include "eqep.h"
#include "iio_imu.h"
#include "mc33926.h"
#include "mpu9250.h"
#include "tb6612.h"

typedef struct bbb_wheel {
  enum bbb_bridge type;
  bool open;
  union {
    mc33926_t mc33926;
    tb6612_t tb6612;
  } driver;
  eqep_t encoder;
  bool encoder_reversed;
} bbb_wheel_t;

typedef struct bbb {
  mpu9250_t imu;
  iio_imu_t iio; /* in its place */
  bool own_pace; /* ticks by our clock: the IMU's rate is another */
  dmp_t dmp;
  bool has_dmp;
  double gyro_scale; /* to the boundary's counts: 16.4 per deg/s, 4096 per g */
  double accel_scale;
  gpio_line_t ready;
  int64_t period_ns;
  int64_t late_after_ns;
  int64_t tick_ns; /* the last tick, or when it was due */
  int64_t sample_ns;
  bool late;
  bool imu_gone;
  bbb_wheel_t wheel[RIO_MAX_MOTORS];
  uint32_t wheels;
  gpio_line_t enable;
  bool enabled;
  adc_t battery;
  uint32_t battery_every_ticks;
  uint32_t battery_in_ticks;
  int battery_status;
  int32_t battery_counts;
  bbb_status_t status;
} bbb_t;

extern const rio_ops_t bbb_ops;
void bbb_close(void* self); /* also of a board opened halfway */

#endif
