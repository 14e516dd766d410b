#include "adc.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#include "sysfs.h"

int adc_open(adc_t* adc, const char* device, unsigned channel) {
  adc->fd = -1;
  char dir[SYSFS_PATH_MAX];
  const int status = sysfs_find("/sys/bus/iio/devices", "iio:device", device, dir);
  if (status < 0) return status;
  char attribute[32];
  snprintf(attribute, sizeof attribute, "in_voltage%u_raw", channel);
  adc->fd = sysfs_open(dir, attribute, O_RDONLY);
  return adc->fd < 0 ? adc->fd : 0;
}

int adc_read(const adc_t* adc, int32_t* counts) {
  int64_t value = 0;
  const int status = sysfs_read_i64(adc->fd, &value);
  if (status < 0) return status;
  if (value < 0 || value > ADC_MAX_COUNT) return -ERANGE;
  *counts = (int32_t)value;
  return 0;
}

void adc_close(adc_t* adc) {
  if (adc->fd >= 0) close(adc->fd);
  adc->fd = -1;
}
