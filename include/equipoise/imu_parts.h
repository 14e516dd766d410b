/* imu_parts.h: the IMUs that a board may have, one table for driver, estimator, design and simulated world.
 * In: part, low-pass setting (0: none) -> out: bandwidth, delay, noise, and the rate at which the kernel's
 * driver has that setting. Sources: MPU: RM-MPU-9250A rev. 1.6 tables 3 and 5 (setting = register value),
 * PS-MPU-9250A; DS-000347; DS12140; BST-BMI270-DS000 (noise; bandwidths not re-checked). Delay of these
 * three: of a second-order Butterworth filter. RT-safe: loads. */
#ifndef EQUIPOISE_IMU_PARTS_H
#define EQUIPOISE_IMU_PARTS_H

#include <math.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { IMU_PARTS = 5, IMU_LOW_PASS_MAX = 6 };

typedef struct {
  uint16_t rate_hz; /* at which the kernel's driver chooses it; 0: it never does */
  double gyro_hz, accel_hz;
  double gyro_delay_s, accel_delay_s;
} imu_low_pass_t;

typedef struct {
  const char* name;                       /* in board and configuration files */
  const char *gyro_device, *accel_device; /* of the kernel's driver: one device, or one each */
  double gyro_rad_s_sqrt_hz, accel_m_s2_sqrt_hz;
  imu_low_pass_t low_pass[IMU_LOW_PASS_MAX + 1];
} imu_part_t;

#define IMU_DEG 0.017453292519943295
#define IMU_MICRO_G 9.80665e-6
#define IMU_MPU_LOW_PASS                                                                                \
  {                                                                                                     \
    {0, 250, 218, 0.97e-3, 1.88e-3}, {500, 184, 218, 2.9e-3, 1.88e-3}, {200, 92, 99, 3.9e-3, 2.88e-3},  \
        {100, 41, 45, 5.9e-3, 4.88e-3}, {50, 20, 21, 9.9e-3, 8.87e-3}, {0, 10, 10, 17.85e-3, 16.83e-3}, \
        {0, 5, 5, 33.48e-3, 32.48e-3},                                                                  \
  }

/* The part of this place in the table, 0 to IMU_PARTS - 1. */
static inline const imu_part_t* imu_part(int index) {
  static const imu_part_t parts[IMU_PARTS] = {
      {"mpu9250", "mpu9250", "mpu9250", 0.01 * IMU_DEG, 300 * IMU_MICRO_G, IMU_MPU_LOW_PASS},
      {"mpu6500", "mpu6500", "mpu6500", 0.01 * IMU_DEG, 300 * IMU_MICRO_G, IMU_MPU_LOW_PASS},
      {"icm42688",
       "icm42688-gyro",
       "icm42688-accel",
       0.0028 * IMU_DEG,
       70 * IMU_MICRO_G,
       {{0, 0, 0, 0, 0},
        {200, 100, 100, 2.25e-3, 2.25e-3},
        {500, 250, 250, 0.90e-3, 0.90e-3},
        {1000, 500, 500, 0.45e-3, 0.45e-3}}},
      {"lsm6dso",
       "lsm6dso_gyro",
       "lsm6dso_accel",
       0.0038 * IMU_DEG,
       80 * IMU_MICRO_G,
       {{0, 0, 0, 0, 0}, {416, 136, 208, 1.66e-3, 1.08e-3}, {833, 295, 416, 0.76e-3, 0.54e-3}}},
      {"bmi270",
       "bmi270",
       "bmi270",
       0.007 * IMU_DEG,
       160 * IMU_MICRO_G,
       {{0, 0, 0, 0, 0},
        {200, 75, 80, 3.00e-3, 2.81e-3},
        {400, 137, 162, 1.64e-3, 1.39e-3},
        {800, 255, 324, 0.88e-3, 0.69e-3}}},
  };
  return &parts[index >= 0 && index < IMU_PARTS ? index : 0];
}

static inline const imu_low_pass_t* imu_low_pass(int part, int setting) {
  static const imu_low_pass_t none = {0, 0, 0, 0, 0};
  return setting >= 0 && setting <= IMU_LOW_PASS_MAX ? &imu_part(part)->low_pass[setting] : &none;
}

/* Noise of one sample: of a second-order filter, which lets through 1.11 times its bandwidth. */
static inline double imu_gyro_sigma_rad_s(int part, int setting) {
  return imu_part(part)->gyro_rad_s_sqrt_hz * sqrt(1.11 * imu_low_pass(part, setting)->gyro_hz);
}

static inline double imu_accel_sigma_m_s2(int part, int setting) {
  return imu_part(part)->accel_m_s2_sqrt_hz * sqrt(1.11 * imu_low_pass(part, setting)->accel_hz);
}

#ifdef __cplusplus
}
#endif

#endif
