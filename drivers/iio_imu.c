#define _GNU_SOURCE /* ppoll */
#include "iio_imu.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "monotonic.h"

static const double kGravity_m_s2 = 9.80665;
static const double kCountsPerRad_s = 16.4 / IMU_DEG; /* the boundary's, equipoise/sample.h */
static const double kCountsPerG = 4096.0;

static void want(iio_device_t* device, const char* kind, const char* what, bool optional) {
  iio_channel_t* channel = &device->channel[device->channels++];
  snprintf(channel->name, sizeof channel->name, "%s%s", kind, what);
  channel->optional = optional;
}

/* Channels of one kind: rate, range, mount; then their matrix to the boundary's counts. */
static int open_kind(iio_device_t* device, const char* kind, double rate_hz, double range,
                     double counts_per_unit, double matrix[9], iio_fault_t* fault) {
  want(device, kind, "_x", false);
  want(device, kind, "_y", false);
  want(device, kind, "_z", false);
  double per_count = 0.0;
  int status = iio_set_rate(device, kind, rate_hz, fault);
  if (status == 0) status = iio_set_range(device, kind, range, &per_count, fault);
  if (status == 0) status = iio_read_mount(device, kind, matrix, fault);
  for (int i = 0; i < 9; ++i) matrix[i] *= per_count * counts_per_unit;
  return status;
}

static int read_temperature_scale(iio_imu_t* imu, iio_fault_t* fault) {
  const iio_device_t* device = &imu->device[0];
  if (device->channel[3].name[0] == '\0') return 0;
  const int status = iio_read_decimal(device, "in_temp_scale", &imu->temperature_scale, fault);
  iio_fault_t absent;
  if (iio_read_decimal(device, "in_temp_offset", &imu->temperature_offset, &absent) < 0)
    imu->temperature_offset = 0.0;
  return status;
}

static int open_devices(iio_imu_t* imu, const iio_imu_config_t* config, iio_fault_t* fault) {
  const imu_part_t* part = imu_part(config->part);
  const double rate_hz = imu_low_pass(config->part, config->low_pass)->rate_hz;
  iio_device_t* gyro = &imu->device[0];
  imu->devices = 1;
  int status = iio_open(gyro, part->gyro_device, fault);
  if (status == 0)
    status = open_kind(gyro, "in_anglvel", rate_hz, config->gyro_range_dps * IMU_DEG, kCountsPerRad_s,
                       imu->gyro, fault);
  if (status < 0) return status;
  want(gyro, "in_temp", "", true);
  want(gyro, "in_timestamp", "", false);
  iio_device_t* accel = gyro;
  if (strcmp(part->accel_device, part->gyro_device) != 0) {
    accel = &imu->device[1];
    imu->devices = 2;
    status = iio_open(accel, part->accel_device, fault);
  }
  const double range_m_s2 = config->accel_range_g * kGravity_m_s2;
  if (status == 0)
    status =
        open_kind(accel, "in_accel", rate_hz, range_m_s2, kCountsPerG / kGravity_m_s2, imu->accel, fault);
  if (imu->devices == 2) want(accel, "in_timestamp", "", false);
  for (int i = 0; status == 0 && i < imu->devices; ++i)
    status = iio_start(&imu->device[i], config->trigger, fault);
  return status == 0 ? read_temperature_scale(imu, fault) : status;
}

int iio_imu_open(iio_imu_t* imu, const iio_imu_config_t* config, iio_fault_t* fault) {
  memset(imu, 0, sizeof *imu);
  memset(fault, 0, sizeof *fault);
  imu->device[0].fd = imu->device[1].fd = -1;
  imu->repeats.stuck_after = config->stuck_after;
  imu->stale_after_ns = config->stale_after_ns;
  const int status = open_devices(imu, config, fault);
  if (status < 0) iio_imu_close(imu);
  return status;
}

static const iio_channel_t* time_of(const iio_imu_t* imu, int index) {
  return &imu->device[index].channel[index == 0 ? 4 : 3];
}

/* Takes what has come to one device; -errno when it is broken. */
static int take(iio_imu_t* imu, int index, int64_t now_ns) {
  const uint8_t* scan = NULL;
  const int count = iio_newest(&imu->device[index], &scan);
  if (count <= 0) return count;
  const int64_t stamp_ns = iio_value(time_of(imu, index), scan);
  if (stamp_ns <= imu->stamp_ns[index] || now_ns - stamp_ns > imu->stale_after_ns) return 0;
  imu->stamp_ns[index] = stamp_ns;
  memcpy(imu->scan[index], scan, imu->device[index].scan_bytes);
  imu->fresh[index] = true;
  return count;
}

int iio_imu_wait(iio_imu_t* imu, int64_t deadline_ns, int64_t* scan_ns) {
  int scans = 0;
  for (;;) {
    struct pollfd waiting[2];
    nfds_t missing = 0;
    const int64_t now_ns = monotonic_ns();
    for (int i = 0; i < imu->devices; ++i) {
      const int count = take(imu, i, now_ns);
      if (count < 0) return count;
      if (i == 0) scans += count;
      if (!imu->fresh[i])
        waiting[missing++] = (struct pollfd){.fd = imu->device[i].fd, .events = POLLIN, .revents = 0};
    }
    if (missing == 0) {
      *scan_ns = imu->stamp_ns[0] < now_ns ? imu->stamp_ns[0] : now_ns;
      return scans > 0 ? scans : 1;
    }
    const int64_t left_ns = deadline_ns - now_ns;
    if (left_ns <= 0) return 0;
    const struct timespec timeout = {.tv_sec = (time_t)(left_ns / 1000000000),
                                     .tv_nsec = (long)(left_ns % 1000000000)};
    const int ready = ppoll(waiting, missing, &timeout, NULL);
    if (ready < 0 && errno != EINTR) return -errno;
    for (nfds_t i = 0; ready > 0 && i < missing; ++i) {
      if ((waiting[i].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0 && (waiting[i].revents & POLLIN) == 0)
        return -ENODEV;
    }
  }
}

static void counts_of(const iio_device_t* device, int first, const uint8_t* scan, const double matrix[9],
                      int32_t raw[3], double counts[3], bool* clipped) {
  for (int i = 0; i < 3; ++i) {
    const iio_channel_t* channel = &device->channel[first + i];
    raw[i] = (int32_t)iio_value(channel, scan);
    const int64_t end = iio_end_value(channel);
    if (raw[i] >= end || raw[i] <= -end - 1) *clipped = true;
  }
  for (size_t i = 0; i < 3; ++i)
    counts[i] = matrix[3 * i] * raw[0] + matrix[3 * i + 1] * raw[1] + matrix[3 * i + 2] * raw[2];
}

int iio_imu_read(iio_imu_t* imu, iio_imu_sample_t* out) {
  const int last = imu->devices - 1;
  if (imu->devices == 0 || !imu->fresh[0] || !imu->fresh[last]) return -EAGAIN;
  memset(out, 0, sizeof *out);
  int32_t axes[6];
  counts_of(&imu->device[last], last == 0 ? 5 : 0, imu->scan[last], imu->accel, axes, out->accel_counts,
            &out->clipped);
  counts_of(&imu->device[0], 0, imu->scan[0], imu->gyro, axes + 3, out->gyro_counts, &out->clipped);
  const iio_channel_t* temperature = &imu->device[0].channel[3];
  if (temperature->name[0] != '\0') /* milli degC */
    out->temperature_degC = 1e-3 * imu->temperature_scale *
                            ((double)iio_value(temperature, imu->scan[0]) + imu->temperature_offset);
  out->stuck = repeats_stuck(&imu->repeats, axes);
  imu->fresh[0] = imu->fresh[1] = false;
  return 0;
}

void iio_imu_close(iio_imu_t* imu) {
  for (int i = 0; i < imu->devices; ++i) iio_close(&imu->device[i]);
  imu->devices = 0;
}
