/* bbb.h: a BeagleBone Black as a rio_t: IMU (raw or with DMP), encoders, bridges, battery.
 * In: the wiring. Out: raw counts and health; a broken sensor is a clear bit, never a stale value.
 * Tick: the IMU's data-ready edge, or the deadline if it does not come. Motors are off after open, close and
 * every failed write. Everything but open and close is real-time safe: system calls of the drivers, no
 * allocation. */
#ifndef EQUIPOISE_DRIVERS_BBB_H
#define EQUIPOISE_DRIVERS_BBB_H

#include "bbb_config.h"

#ifdef __cplusplus
extern "C" {
#endif

/* 0, or -errno with `error` saying which device and why; nothing is left open or running then. */
int bbb_open(const bbb_config_t* config, rio_t* out, bbb_error_t* error);

typedef struct bbb_status {
  uint8_t who_am_i;
  bool imu_variant; /* works, but is no MPU-9250: warn */
  bool has_dmp;
  uint32_t late_ticks;                    /* edges that did not come */
  uint32_t missed_edges;                  /* edges that came while the loop was busy */
  uint32_t bridge_faults[RIO_MAX_MOTORS]; /* SF events */
} bbb_status_t;

void bbb_get_status(const rio_t* io, bbb_status_t* out);

#ifdef __cplusplus
}
#endif

#endif
