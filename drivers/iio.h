/* iio.h: the buffer of one device of Linux' Industrial I/O: /sys/bus/iio, /dev/iio:deviceN. In: the device's
 * name, channels. Out: scans, newest first, and what their bytes mean. A device is found by name, never by
 * number. Opening says which file, which value and what to do (iio_fault_t); iio_newest and iio_value are
 * real-time safe: reads of a non-blocking descriptor. */
#ifndef EQUIPOISE_DRIVERS_IIO_H
#define EQUIPOISE_DRIVERS_IIO_H

#include <stdbool.h>
#include <stdint.h>

#include "sysfs.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { IIO_CHANNELS = 8, IIO_SCAN_MAX = 64, IIO_LENGTH = 64 };

typedef struct iio_fault {
  char where[160];    /* device, file, value */
  const char* advice; /* what to do; NULL: the error's number says it */
} iio_fault_t;

typedef struct iio_channel {
  char name[16]; /* "in_accel_x"; empty: not delivered */
  bool optional; /* a device without it will do */
  bool big_endian;
  uint8_t bits, bytes, shift;
  uint32_t offset; /* in a scan */
  int64_t index;   /* among the device's channels */
} iio_channel_t;

typedef struct iio_device {
  const char* name;
  char dir[SYSFS_PATH_MAX];
  int fd;
  int channels;
  iio_channel_t channel[IIO_CHANNELS];
  uint32_t scan_bytes;
  uint8_t queue[IIO_LENGTH * IIO_SCAN_MAX];
} iio_device_t;

/* In this order. `device->channel` says which, by name. After a failure, too, iio_close. */
int iio_open(iio_device_t* device, const char* name, iio_fault_t* fault);
int iio_set_rate(const iio_device_t* device, const char* kind, double rate_hz, iio_fault_t* fault);
/* The smallest range of at least `range`, and what a count is in it. Kind: "in_accel", "in_anglvel". */
int iio_set_range(const iio_device_t* device, const char* kind, double range, double* per_count,
                  iio_fault_t* fault);
int iio_read_mount(const iio_device_t* device, const char* kind, double rows[9], iio_fault_t* fault);
int iio_read_decimal(const iio_device_t* device, const char* file, double* out, iio_fault_t* fault);
int iio_start(iio_device_t* device, const char* trigger, iio_fault_t* fault);

/* How many scans have come, 0, or -errno (-EBADMSG: part of one); *scan is the newest. */
int iio_newest(iio_device_t* device, const uint8_t** scan);
int64_t iio_value(const iio_channel_t* channel, const uint8_t* scan);
int64_t iio_end_value(const iio_channel_t* channel); /* of its range */
void iio_close(iio_device_t* device);

#ifdef __cplusplus
}
#endif

#endif
