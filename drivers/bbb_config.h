/* bbb_config.h: the wiring of one robot on a BeagleBone Black, as plain data: what a file of config/boards
 * says and src/app fills in. Devices by address or label, never by number. Strings are copied,
 * zero-terminated. */
#ifndef EQUIPOISE_DRIVERS_BBB_CONFIG_H
#define EQUIPOISE_DRIVERS_BBB_CONFIG_H

#include <stdbool.h>
#include <stdint.h>

#include "equipoise/imu_parts.h"
#include "robot_io.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { BBB_NAME_MAX = 64, BBB_FILE_MAX = 256 };

typedef struct bbb_pin {
  bool used;
  char chip[BBB_NAME_MAX]; /* label or address: "44e07000" */
  uint32_t line;
  bool active_low;
} bbb_pin_t;

enum bbb_bridge { BBB_MC33926, BBB_TB6612 };

typedef struct bbb_motor {
  enum bbb_bridge bridge;
  bbb_pin_t in1; /* high with in2 low: forward */
  bbb_pin_t in2;
  bbb_pin_t fault;            /* SF of an MC33926; optional */
  char pwm[BBB_NAME_MAX];     /* "48302200" */
  uint32_t pwm_channel;       /* 0: A, 1: B */
  bool motor_reversed;        /* positive duty must turn the encoder up */
  char encoder[BBB_NAME_MAX]; /* "48300180" */
  bool encoder_reversed;
} bbb_motor_t;

enum bbb_imu_driver { BBB_IMU_MPU9250, BBB_IMU_IIO };

typedef struct bbb_imu {
  enum bbb_imu_driver driver;
  int part;                   /* of equipoise/imu_parts.h */
  char trigger[BBB_NAME_MAX]; /* IIO; empty: the kernel driver's own */
  char bus[BBB_NAME_MAX];     /* "/dev/i2c-2" */
  uint16_t address;
  uint16_t rate_hz; /* the loop's rate */
  uint16_t gyro_range_dps;
  uint16_t accel_range_g;
  uint8_t dlpf;                    /* setting of the part's low pass, 1 .. 6 */
  uint16_t stuck_after;            /* samples; 0: never */
  bbb_pin_t interrupt;             /* active_low: falling edge */
  uint32_t late_after_us;          /* the tick comes this long after a missing edge */
  char dmp_firmware[BBB_FILE_MAX]; /* empty: no DMP */
} bbb_imu_t;

typedef struct bbb_config {
  bbb_imu_t imu;
  uint32_t motors;
  bbb_motor_t motor[RIO_MAX_MOTORS];
  uint32_t pwm_hz;
  bbb_pin_t enable;           /* EN of the carriers, standby of the cape */
  bool enable_held_elsewhere; /* by the guard process: then write_motors leaves the line alone */
  char adc[BBB_NAME_MAX];     /* "TI-am335x-adc" */
  uint32_t battery_channel;
  uint32_t battery_every_ticks; /* a conversion is not worth its time in every tick */
} bbb_config_t;

typedef struct bbb_error {
  int code;       /* -errno */
  char text[256]; /* what, which device, why: one line, no newline */
} bbb_error_t;

#ifdef __cplusplus
}
#endif

#endif
