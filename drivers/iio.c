#include "iio.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TEXT_MAX = 256 };

/* --- opening --- */

static int fail(iio_fault_t* fault, int code, const char* device, const char* file, const char* value,
                const char* advice) {
  snprintf(fault->where, sizeof fault->where, "%.40s%s%.48s%s%.60s%s", device, file[0] == '\0' ? "" : " ",
           file, value == NULL ? "" : " \"", value == NULL ? "" : value, value == NULL ? "" : "\"");
  fault->advice = advice;
  return code;
}

static const char* refused(int code) {
  return code == -EACCES || code == -EPERM ? "no permission: group or udev rule"
                                           : "the kernel's driver has no such file or refuses the value";
}

static int read_text(const iio_device_t* device, const char* file, char text[TEXT_MAX], iio_fault_t* fault) {
  const int status = sysfs_read_text(device->dir, file, text, TEXT_MAX);
  return status < 0 ? fail(fault, status, device->name, file, NULL, refused(status)) : 0;
}

static int write_text(const iio_device_t* device, const char* file, const char* text, iio_fault_t* fault) {
  const int status = sysfs_write_text(device->dir, file, text);
  return status < 0 ? fail(fault, status, device->name, file, text, refused(status)) : 0;
}

static bool has_file(const iio_device_t* device, const char* file) {
  char path[SYSFS_PATH_MAX];
  return sysfs_join(path, device->dir, file) == 0 && access(path, F_OK) == 0;
}

int iio_read_decimal(const iio_device_t* device, const char* file, double* out, iio_fault_t* fault) {
  char text[TEXT_MAX];
  const int status = read_text(device, file, text, fault);
  if (status < 0) return status;
  char* end = text;
  *out = strtod(text, &end);
  if (end != text && *end == '\0' && isfinite(*out)) return 0;
  return fail(fault, -EBADMSG, device->name, file, text,
              "is no number: another kernel driver, or a fault of this one");
}

int iio_open(iio_device_t* device, const char* name, iio_fault_t* fault) {
  memset(device, 0, sizeof *device);
  device->fd = -1;
  device->name = name;
  const int status = sysfs_find("/sys/bus/iio/devices", "iio:device", name, device->dir);
  if (status < 0)
    return fail(fault, status, name, "", NULL,
                "no IIO device of this name: device tree, kernel module; cat /sys/bus/iio/devices/*/name");
  char path[SYSFS_PATH_MAX];
  const int joined = sysfs_join(path, "/dev", strrchr(device->dir, '/') + 1);
  if (joined < 0) return joined;
  device->fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (device->fd >= 0) return write_text(device, "buffer/enable", "0", fault); /* else nothing can be set */
  return fail(fault, -errno, name, path, NULL,
              errno == EBUSY ? "held by another process, e.g. iiod"
                             : "no permission, or a kernel without IIO buffers");
}

int iio_set_rate(const iio_device_t* device, const char* kind, double rate_hz, iio_fault_t* fault) {
  char file[48];
  snprintf(file, sizeof file, "sampling_frequency");
  if (!has_file(device, file)) snprintf(file, sizeof file, "%s_sampling_frequency", kind);
  char text[32];
  snprintf(text, sizeof text, "%g", rate_hz);
  int status = write_text(device, file, text, fault);
  double kept = 0.0;
  if (status == 0) status = iio_read_decimal(device, file, &kept, fault);
  if (status < 0 || fabs(kept - rate_hz) <= 0.02 * rate_hz) return status;
  snprintf(text, sizeof text, "%g", kept);
  return fail(fault, -EINVAL, device->name, file, text,
              "is not the rate of [imu] low_pass: choose another one");
}

/* The smallest of a list that is at least `wanted`, as the driver writes it; false: none. */
static bool choose(char* list, double wanted, char** chosen) {
  double best = INFINITY;
  char* rest = NULL;
  for (char* each = strtok_r(list, " ", &rest); each != NULL; each = strtok_r(NULL, " ", &rest)) {
    const double value = strtod(each, NULL);
    if (value < wanted || value >= best) continue;
    best = value;
    *chosen = each;
  }
  return isfinite(best);
}

int iio_set_range(const iio_device_t* device, const char* kind, double range, double* per_count,
                  iio_fault_t* fault) {
  char file[48], available[64], list[TEXT_MAX], shown[TEXT_MAX];
  snprintf(file, sizeof file, "%s_scale", kind);
  if (!has_file(device, file)) snprintf(file, sizeof file, "%s_x_scale", kind);
  snprintf(available, sizeof available, "%s_available", file);
  const double wanted = 0.98 * range / 32768.0; /* drivers round */
  if (has_file(device, available)) {
    int status = read_text(device, available, list, fault);
    if (status < 0) return status;
    memcpy(shown, list, sizeof shown);
    char* chosen = NULL;
    if (!choose(list, wanted, &chosen))
      return fail(fault, -ERANGE, device->name, available, shown,
                  "has none for the board file's range: choose a smaller one");
    status = write_text(device, file, chosen, fault);
    if (status < 0) return status;
  }
  const int status = iio_read_decimal(device, file, per_count, fault);
  if (status < 0 || *per_count >= wanted) return status;
  snprintf(shown, sizeof shown, "%g", *per_count);
  return fail(fault, -ERANGE, device->name, file, shown,
              "is less than the board file's range: choose a smaller one");
}

static bool is_rotation(const double r[9]) {
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = i; j < 3; ++j) {
      const double dot = r[3 * i] * r[3 * j] + r[3 * i + 1] * r[3 * j + 1] + r[3 * i + 2] * r[3 * j + 2];
      if (!(fabs(dot - (i == j ? 1.0 : 0.0)) < 1e-3)) return false;
    }
  }
  return r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
             r[2] * (r[3] * r[7] - r[4] * r[6]) >
         0.0;
}

int iio_read_mount(const iio_device_t* device, const char* kind, double rows[9], iio_fault_t* fault) {
  char file[48], text[TEXT_MAX];
  snprintf(file, sizeof file, "%s_mount_matrix", kind);
  if (!has_file(device, file)) snprintf(file, sizeof file, "in_mount_matrix");
  if (!has_file(device, file)) snprintf(file, sizeof file, "mount_matrix");
  memset(rows, 0, 9 * sizeof *rows);
  rows[0] = rows[4] = rows[8] = 1.0;
  if (!has_file(device, file)) return 0;
  const int status = read_text(device, file, text, fault);
  if (status < 0) return status;
  char* next = text;
  int count = 0;
  for (; count < 9; ++count) {
    char* end = next;
    rows[count] = strtod(next, &end);
    if (end == next) break;
    next = end + strspn(end, ",; ");
  }
  if (count == 9 && *next == '\0' && is_rotation(rows)) return 0;
  return fail(fault, -EINVAL, device->name, file, text, "is no rotation: mount-matrix in the device tree");
}

static iio_channel_t* wanted_channel(iio_device_t* device, const char* file, size_t length) {
  for (int i = 0; i < device->channels; ++i) {
    iio_channel_t* channel = &device->channel[i];
    if (strlen(channel->name) == length && strncmp(channel->name, file, length) == 0) return channel;
  }
  return NULL;
}

/* Only what is wanted is in a scan: whatever someone else has switched on goes. */
static int enable_channels(iio_device_t* device, iio_fault_t* fault) {
  char path[SYSFS_PATH_MAX];
  int status = sysfs_join(path, device->dir, "scan_elements");
  DIR* elements = status < 0 ? NULL : opendir(path);
  if (elements == NULL)
    return fail(fault, -ENOENT, device->name, "scan_elements", NULL,
                "this driver has no buffer: is its interrupt in the device tree?");
  for (const struct dirent* entry = NULL; status == 0 && (entry = readdir(elements)) != NULL;) {
    const size_t length = strlen(entry->d_name);
    if (length < 4 || length > 60 || strcmp(entry->d_name + length - 3, "_en") != 0) continue;
    char file[80];
    snprintf(file, sizeof file, "scan_elements/%.60s", entry->d_name);
    status = write_text(device, file, wanted_channel(device, entry->d_name, length - 3) != NULL ? "1" : "0",
                        fault);
  }
  closedir(elements);
  return status;
}

/* "le:s16/16>>0": byte order, signed bits of how many, shift. */
static bool parse_type(const char* text, iio_channel_t* channel) {
  char order = 0;
  unsigned bits = 0, storage = 0, shift = 0;
  int used = 0;
  if (sscanf(text, "%ce:s%u/%u>>%u%n", &order, &bits, &storage, &shift, &used) != 4 || text[used] != '\0')
    return false;
  if (order != 'b' && order != 'l') return false;
  if (storage != 8 && storage != 16 && storage != 32 && storage != 64) return false;
  if (bits == 0 || bits + shift > storage) return false;
  channel->big_endian = order == 'b';
  channel->bits = (uint8_t)bits;
  channel->bytes = (uint8_t)(storage / 8);
  channel->shift = (uint8_t)shift;
  return true;
}

static int read_channel(const iio_device_t* device, iio_channel_t* channel, iio_fault_t* fault) {
  char file[64], text[TEXT_MAX];
  snprintf(file, sizeof file, "scan_elements/%s_type", channel->name);
  if (!has_file(device, file) && channel->optional) {
    channel->name[0] = '\0';
    return 0;
  }
  int status = read_text(device, file, text, fault);
  if (status < 0) {
    fault->advice = "this device does not deliver the channel: is it the part of [imu] part?";
    return status;
  }
  if (!parse_type(text, channel))
    return fail(fault, -EBADMSG, device->name, file, text, "is no format that can be read here");
  snprintf(file, sizeof file, "scan_elements/%s_index", channel->name);
  double index = 0.0;
  status = iio_read_decimal(device, file, &index, fault);
  channel->index = (int64_t)index;
  return status;
}

/* Channels in the order of their index, each aligned to its size, the scan to its largest. */
static int lay_out(iio_device_t* device, iio_fault_t* fault) {
  uint32_t at = 0, largest = 1;
  int64_t last = -1;
  for (int placed = 0; placed < device->channels; ++placed) {
    iio_channel_t* next = NULL;
    for (int i = 0; i < device->channels; ++i) {
      iio_channel_t* channel = &device->channel[i];
      if (channel->name[0] == '\0' || channel->index <= last) continue;
      if (next == NULL || channel->index < next->index) next = channel;
    }
    if (next == NULL) break;
    at = (at + next->bytes - 1) / next->bytes * next->bytes;
    next->offset = at;
    at += next->bytes;
    last = next->index;
    if (next->bytes > largest) largest = next->bytes;
  }
  device->scan_bytes = (at + largest - 1) / largest * largest;
  return device->scan_bytes > 0 && device->scan_bytes <= IIO_SCAN_MAX
             ? 0
             : fail(fault, -EBADMSG, device->name, "scan_elements", NULL,
                    "a scan is longer than this driver takes");
}

static int set_trigger(const iio_device_t* device, const char* trigger, iio_fault_t* fault) {
  const char* file = "trigger/current_trigger";
  if (!has_file(device, file)) return 0; /* its interrupt fills the buffer without one */
  int status = trigger[0] != '\0' ? write_text(device, file, trigger, fault) : 0;
  char text[TEXT_MAX] = "";
  if (status == 0) status = read_text(device, file, text, fault);
  if (status < 0 || text[0] != '\0') return status;
  return fail(fault, -ENODATA, device->name, file, text,
              "no trigger: name one of /sys/bus/iio/devices/trigger*/name in [imu] trigger");
}

int iio_start(iio_device_t* device, const char* trigger, iio_fault_t* fault) {
  int status = enable_channels(device, fault);
  for (int i = 0; status == 0 && i < device->channels; ++i)
    status = read_channel(device, &device->channel[i], fault);
  if (status == 0) status = lay_out(device, fault);
  if (status == 0) status = write_text(device, "current_timestamp_clock", "monotonic", fault);
  if (status == 0) status = write_text(device, "buffer/length", "64", fault);
  if (status == 0 && has_file(device, "buffer/watermark"))
    status = write_text(device, "buffer/watermark", "1", fault);
  if (status == 0) status = set_trigger(device, trigger, fault);
  if (status == 0) status = write_text(device, "buffer/enable", "1", fault);
  char text[TEXT_MAX] = "";
  if (status == 0) status = read_text(device, "buffer/enable", text, fault);
  if (status < 0 || strcmp(text, "1") == 0) return status;
  return fail(fault, -EIO, device->name, "buffer/enable", text, "the buffer does not start: dmesg says why");
}

void iio_close(iio_device_t* device) {
  if (device->fd < 0) return;
  (void)sysfs_write_text(device->dir, "buffer/enable", "0");
  close(device->fd);
  device->fd = -1;
}

/* --- in the loop --- */

int iio_newest(iio_device_t* device, const uint8_t** scan) {
  const size_t whole = (size_t)device->scan_bytes * IIO_LENGTH;
  int count = 0;
  for (int i = 0; i < 3; ++i) { /* at most a full queue, and what comes meanwhile */
    const ssize_t n = read(device->fd, device->queue, whole);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return count;
    if (n < 0) return -errno;
    if (n == 0) return count > 0 ? count : -ENODEV; /* never of an enabled buffer */
    if ((size_t)n % device->scan_bytes != 0) return -EBADMSG;
    *scan = device->queue + n - device->scan_bytes;
    count += (int)((size_t)n / device->scan_bytes);
    if ((size_t)n < whole) return count;
  }
  return count;
}

int64_t iio_value(const iio_channel_t* channel, const uint8_t* scan) {
  uint64_t value = 0;
  for (uint8_t i = 0; i < channel->bytes; ++i) {
    const uint8_t from = channel->big_endian ? i : (uint8_t)(channel->bytes - 1 - i);
    value = value << 8 | scan[channel->offset + from];
  }
  value >>= channel->shift;
  if (channel->bits < 64) value &= (UINT64_C(1) << channel->bits) - 1;
  const uint64_t sign = UINT64_C(1) << (channel->bits - 1);
  return channel->bits < 64 ? (int64_t)(value ^ sign) - (int64_t)sign : (int64_t)value;
}

int64_t iio_end_value(const iio_channel_t* channel) {
  return (int64_t)((UINT64_C(1) << (channel->bits - 1)) - 1);
}
