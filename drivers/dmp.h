/* dmp.h: the MPU-9250's Digital Motion Processor as an attitude source. Its firmware is proprietary and not
 * part of this project: the user supplies a file of exactly 3062 bytes. In: an opened mpu9250 with +-2000
 * deg/s and +-2 g (InvenSense's own driver) or +-8 g (librobotcontrol since 0.4.0). Out: unit quaternions
 * R_WS at 200 Hz, newest only. dmp_parse is pure; dmp_poll is real-time safe: it never sleeps, a FIFO reset
 * is spread over ticks. Interface: InvenSense eMD 5.1, image 6.12. */
#ifndef EQUIPOISE_DRIVERS_DMP_H
#define EQUIPOISE_DRIVERS_DMP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "i2c_dev.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  DMP_FIRMWARE_BYTES = 3062,
  DMP_PACKET_BYTES = 20,     /* quaternion, gesture: what dmp_start asks for */
  DMP_PACKET_RAW_BYTES = 32, /* quaternion, accel, gyro, gesture */
  DMP_MAX_BACKLOG = 4,       /* packets; more means the loop fell behind: drop them all */
  DMP_MAX_SOFT_RESETS = 3,   /* FIFO resets in a row before the DMP itself is restarted */
  DMP_RESTART_TICKS = 10,    /* 50 ms at 200 Hz, what the DMP needs after its reset */
};

typedef struct dmp_packet {
  double attitude_wxyz[4];
  bool has_raw;
  int16_t accel[3];
  int16_t gyro[3];
} dmp_packet_t;

/* -EMSGSIZE: neither 20 nor 32 bytes; -EBADMSG: not a unit quaternion, so torn or misaligned. */
int dmp_parse(const uint8_t* bytes, size_t length, dmp_packet_t* out);

/* -EFBIG or -ENODATA: not 3062 bytes. */
int dmp_read_firmware(const char* path, uint8_t out[DMP_FIRMWARE_BYTES]);

enum dmp_state { DMP_RUNNING, DMP_CLEARING, DMP_RESTARTING };

typedef struct dmp {
  const i2c_dev_t* i2c;
  enum dmp_state state;
  unsigned wait_ticks;
  unsigned soft_resets;
  unsigned ticks_since_good;
  bool has_last;
  double last_wxyz[4];
} dmp_t;

/* Loads, verifies (-EILSEQ: read-back differs) and starts. Takes about 0.3 s at 400 kHz. */
int dmp_start(dmp_t* dmp, const i2c_dev_t* i2c, const uint8_t firmware[DMP_FIRMWARE_BYTES]);

/* Once per tick. 0: *out is the newest packet; -EAGAIN: none yet; -EBUSY: reset under way; -EOVERFLOW:
 * backlog dropped; -EBADMSG: packet refused; other -errno: bus. Everything but 0 leaves *out alone. */
int dmp_poll(dmp_t* dmp, dmp_packet_t* out);

#ifdef __cplusplus
}
#endif

#endif
