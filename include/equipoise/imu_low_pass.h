/* imu_low_pass.h: how late the MPU-9250 reports, by the value of its low-pass registers CONFIG and
 * ACCEL_CONFIG_2. In: register value 0 to 6 -> out: delay of gyro and accelerometer, s. Source: RM-MPU-9250A
 * rev. 1.6, tables 3 and
 * 5. One table for driver, estimator, design and simulated world. RT-safe: two loads. */
#ifndef EQUIPOISE_IMU_LOW_PASS_H
#define EQUIPOISE_IMU_LOW_PASS_H

#ifdef __cplusplus
extern "C" {
#endif

enum { IMU_LOW_PASS_MAX = 6 };

/* 250, 184, 92, 41, 20, 10, 5 Hz. */
static inline double imu_gyro_delay_s(int low_pass) {
  static const double delay_s[IMU_LOW_PASS_MAX + 1] = {0.97e-3, 2.9e-3,   3.9e-3,  5.9e-3,
                                                       9.9e-3,  17.85e-3, 33.48e-3};
  return low_pass >= 0 && low_pass <= IMU_LOW_PASS_MAX ? delay_s[low_pass] : 0.0;
}

/* 218, 218, 99, 45, 21, 10, 5 Hz. */
static inline double imu_accel_delay_s(int low_pass) {
  static const double delay_s[IMU_LOW_PASS_MAX + 1] = {1.88e-3, 1.88e-3,  2.88e-3, 4.88e-3,
                                                       8.87e-3, 16.83e-3, 32.48e-3};
  return low_pass >= 0 && low_pass <= IMU_LOW_PASS_MAX ? delay_s[low_pass] : 0.0;
}

#ifdef __cplusplus
}
#endif

#endif
