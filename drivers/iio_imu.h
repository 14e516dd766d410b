/* iio_imu.h: an IMU that a driver of the kernel's serves through IIO, as one device or as gyro and
 * accelerometer. In: part and setting of equipoise/imu_parts.h, ranges. Out: samples as the boundary counts
 * them, in the axes of the mount matrix, with the scan's time. Waiting ends by its deadline; wait and read
 * are real-time safe: ppoll and non-blocking reads, no allocation. */
#ifndef EQUIPOISE_DRIVERS_IIO_IMU_H
#define EQUIPOISE_DRIVERS_IIO_IMU_H

#include "equipoise/imu_parts.h"
#include "iio.h"
#include "repeats.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct iio_imu_config {
  int part;
  int low_pass; /* one with a rate */
  uint16_t gyro_range_dps;
  uint16_t accel_range_g;
  uint16_t stuck_after;
  int64_t stale_after_ns; /* an older scan is none */
  const char* trigger;    /* empty: the driver's own */
} iio_imu_config_t;

typedef struct iio_imu_sample {
  double gyro_counts[3];   /* of the boundary: 16.4 per deg/s */
  double accel_counts[3];  /* 4096 per g */
  double temperature_degC; /* 0: not told */
  bool clipped, stuck;
} iio_imu_sample_t;

typedef struct iio_imu {
  int devices; /* 0: not open */
  iio_device_t device[2];
  uint8_t scan[2][IIO_SCAN_MAX]; /* newest of each */
  bool fresh[2];                 /* since the last read */
  int64_t stamp_ns[2];
  int64_t stale_after_ns;
  double gyro[9], accel[9]; /* rows: to the boundary's counts */
  double temperature_scale, temperature_offset;
  repeats_t repeats;
} iio_imu_t;

/* 0, or -errno with `fault` saying file, value and remedy. */
int iio_imu_open(iio_imu_t* imu, const iio_imu_config_t* config, iio_fault_t* fault);

/* Until every device has a scan that is new and not stale, or `deadline_ns`. Returns how many there were, 0
 * at the deadline, or -errno; *scan_ns is the newest one's time, CLOCK_MONOTONIC. As gpio_wait_edge. */
int iio_imu_wait(iio_imu_t* imu, int64_t deadline_ns, int64_t* scan_ns);

/* What waiting found; -EAGAIN: nothing, or taken already. */
int iio_imu_read(iio_imu_t* imu, iio_imu_sample_t* out);
void iio_imu_close(iio_imu_t* imu);

#ifdef __cplusplus
}
#endif

#endif
