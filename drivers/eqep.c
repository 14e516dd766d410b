#include "eqep.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "sysfs.h"

static const uint64_t kModulus32 = (uint64_t)1 << 32;

int64_t eqep_difference(uint64_t last, uint64_t now, uint64_t modulus) {
  const uint64_t forward = now >= last ? now - last : now + modulus - last;
  return forward > modulus / 2 ? -(int64_t)(modulus - forward) : (int64_t)forward;
}

/* The counter as the hardware sees it: unsigned, below the modulus. The 4.x interface prints it signed. */
static int read_raw(const eqep_t* encoder, uint64_t* out) {
  int64_t value = 0;
  const int status = sysfs_read_i64(encoder->fd, &value);
  if (status < 0) return status;
  if (value < 0) value += (int64_t)kModulus32;
  if (value < 0 || (uint64_t)value >= encoder->modulus) return -ERANGE;
  *out = (uint64_t)value;
  return 0;
}

static int open_counter(eqep_t* encoder, const char* dir) {
  char count_dir[SYSFS_PATH_MAX];
  int status = sysfs_join(count_dir, dir, "count0");
  /* The ceiling resets to 0, where the count would stay; it must be set before the decoder runs. */
  if (status == 0) status = sysfs_write_number(count_dir, "enable", 0);
  if (status == 0) status = sysfs_write_text(count_dir, "function", "quadrature x4\n");
  if (status == 0) status = sysfs_write_number(count_dir, "ceiling", UINT32_MAX);
  int64_t kept = 0; /* some decoders round it */
  if (status == 0) status = sysfs_read_number(count_dir, "ceiling", &kept);
  if (status == 0 && kept < 1) status = -ERANGE;
  if (status == 0) status = sysfs_write_number(count_dir, "enable", 1);
  if (status < 0) return status;
  encoder->modulus = (uint64_t)kept + 1;
  encoder->fd = sysfs_open(count_dir, "count", O_RDONLY);
  return encoder->fd < 0 ? encoder->fd : 0;
}

static int open_position(eqep_t* encoder, const char* dir) {
  int status = sysfs_write_number(dir, "mode", 0); /* absolute position */
  if (status == -ENOENT) status = 0;               /* not every 4.x kernel has modes */
  if (status == 0) status = sysfs_write_number(dir, "enabled", 1);
  if (status < 0) return status;
  encoder->modulus = kModulus32;
  encoder->fd = sysfs_open(dir, "position", O_RDONLY);
  return encoder->fd < 0 ? encoder->fd : 0;
}

int eqep_open(eqep_t* encoder, const char* device) {
  memset(encoder, 0, sizeof *encoder);
  encoder->fd = -1;
  char dir[SYSFS_PATH_MAX];
  int status = sysfs_find("/sys/bus/counter/devices", "counter", device, dir);
  if (status == 0) {
    status = open_counter(encoder, dir);
  } else if (status == -ENODEV) {
    status = sysfs_find("/sys/bus/platform/devices", device, device, dir);
    if (status == 0) status = open_position(encoder, dir);
  }
  if (status == 0) status = read_raw(encoder, &encoder->last);
  if (status < 0) eqep_close(encoder);
  return status;
}

int eqep_read(eqep_t* encoder, int64_t* counts) {
  uint64_t now = 0;
  const int status = read_raw(encoder, &now);
  if (status < 0) return status;
  encoder->counts += eqep_difference(encoder->last, now, encoder->modulus);
  encoder->last = now;
  *counts = encoder->counts;
  return 0;
}

void eqep_close(eqep_t* encoder) {
  if (encoder->modulus != 0 && encoder->fd >= 0) close(encoder->fd);
  encoder->fd = -1;
}
