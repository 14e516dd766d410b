#include "pwm.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "monotonic.h"

enum { EXPORT_WAIT_MS = 5000, EXPORT_POLL_MS = 10 };

/* "pwm1", or on BeagleBoard.org kernels "pwm-4:1" with the chip's number. */
static int channel_dir(char out[SYSFS_PATH_MAX], const char* chip_dir, unsigned channel) {
  char name[32];
  snprintf(name, sizeof name, "pwm%u", channel);
  int status = sysfs_join(out, chip_dir, name);
  if (status < 0) return status;
  if (access(out, F_OK) == 0) return 0;
  const char* number = strrchr(chip_dir, '/');
  number = number == NULL ? chip_dir : number + 1;
  number += strcspn(number, "0123456789");
  snprintf(name, sizeof name, "pwm-%.8s:%u", number, channel);
  status = sysfs_join(out, chip_dir, name);
  if (status < 0) return status;
  return access(out, F_OK) == 0 ? 0 : -ENOENT;
}

static int writable(const char* dir) {
  static const char* const attributes[] = {"period", "duty_cycle", "enable"};
  for (size_t i = 0; i < sizeof attributes / sizeof *attributes; ++i) {
    const int fd = sysfs_open(dir, attributes[i], O_WRONLY);
    if (fd < 0) return fd;
    close(fd);
  }
  return 0;
}

/* After the export udev hands the attributes to our group, a moment later, and one after the other. */
static int wait_writable(pwm_t* pwm) {
  int status = -ENOENT;
  for (int waited = 0; waited <= EXPORT_WAIT_MS; waited += EXPORT_POLL_MS) {
    status = channel_dir(pwm->dir, pwm->chip_dir, pwm->channel);
    if (status == 0) status = writable(pwm->dir);
    if (status != -EACCES) break;
    sleep_ms(EXPORT_POLL_MS);
  }
  return status;
}

static int export_channel(pwm_t* pwm) {
  if (channel_dir(pwm->dir, pwm->chip_dir, pwm->channel) == 0) return wait_writable(pwm);
  const int status = sysfs_write_number(pwm->chip_dir, "export", pwm->channel);
  if (status < 0 && status != -EBUSY) return status;
  pwm->exported_here = status == 0;
  return wait_writable(pwm);
}

static int check_shared_period(const pwm_t* pwm) {
  char sibling[SYSFS_PATH_MAX];
  int64_t period_ns = 0;
  int64_t enabled = 0;
  if (channel_dir(sibling, pwm->chip_dir, pwm->channel ^ 1u) < 0) return 0;
  if (sysfs_read_number(sibling, "period", &period_ns) < 0) return 0;
  if (sysfs_read_number(sibling, "enable", &enabled) < 0 || enabled == 0) return 0;
  return period_ns == (int64_t)pwm->period_ns ? 0 : -EINVAL;
}

/* Order matters: a period below the old on-time is refused, an on-time without a period too, and enabling
 * before both would start the old waveform. */
static int start(pwm_t* pwm) {
  int64_t old_period_ns = 0;
  int status = sysfs_read_number(pwm->dir, "period", &old_period_ns);
  if (status == 0 && old_period_ns > 0) status = sysfs_write_number(pwm->dir, "duty_cycle", 0);
  if (status == 0 && old_period_ns > 0) status = sysfs_write_number(pwm->dir, "enable", 0);
  if (status == 0) status = sysfs_write_number(pwm->dir, "period", pwm->period_ns);
  if (status < 0) return status;
  pwm->duty_fd = sysfs_open(pwm->dir, "duty_cycle", O_WRONLY);
  if (pwm->duty_fd < 0) return pwm->duty_fd;
  status = sysfs_write_u32(pwm->duty_fd, 0);
  return status < 0 ? status : sysfs_write_number(pwm->dir, "enable", 1);
}

int pwm_open(pwm_t* pwm, const char* device, unsigned channel, uint32_t period_ns) {
  memset(pwm, 0, sizeof *pwm);
  pwm->duty_fd = -1;
  pwm->channel = channel;
  pwm->period_ns = period_ns;
  if (period_ns == 0 || channel > 1) return -EINVAL;
  int status = sysfs_find("/sys/class/pwm", "pwmchip", device, pwm->chip_dir);
  if (status < 0) return status;
  status = export_channel(pwm);
  if (status == 0) status = check_shared_period(pwm);
  if (status == 0) status = start(pwm);
  if (status < 0) pwm_close(pwm);
  return status;
}

int pwm_set_ns(pwm_t* pwm, uint32_t on_ns) {
  if (on_ns > pwm->period_ns) return -EINVAL;
  return sysfs_write_u32(pwm->duty_fd, on_ns);
}

int pwm_set_fraction(pwm_t* pwm, double fraction) {
  if (!(fraction >= 0.0 && fraction <= 1.0)) return -EINVAL;
  return pwm_set_ns(pwm, (uint32_t)lround(fraction * (double)pwm->period_ns));
}

void pwm_close(pwm_t* pwm) {
  if (pwm->dir[0] == '\0') return;
  if (pwm->duty_fd >= 0) {
    (void)sysfs_write_u32(pwm->duty_fd, 0);
    close(pwm->duty_fd);
    (void)sysfs_write_number(pwm->dir, "enable",
                             0); /* some kernels oops when a running channel is unexported */
  }
  if (pwm->exported_here) (void)sysfs_write_number(pwm->chip_dir, "unexport", pwm->channel);
  pwm->duty_fd = -1;
  pwm->dir[0] = '\0';
}
