#define _GNU_SOURCE /* ppoll */
#include "gpio.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "gpio_internal.h"
#include "monotonic.h"

static bool has_label(const char* path, const char* label) {
  struct gpiochip_info info;
  memset(&info, 0, sizeof info);
  const int fd = open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool found =
      ioctl(fd, GPIO_GET_CHIPINFO_IOCTL, &info) == 0 && strncmp(info.label, label, sizeof info.label) == 0;
  close(fd);
  return found;
}

int gpio_find_chip(const char* chip, char path[SYSFS_PATH_MAX]) {
  char dir[SYSFS_PATH_MAX];
  if (sysfs_find("/sys/bus/gpio/devices", "gpiochip", chip, dir) == 0) {
    return sysfs_join(path, "/dev", strrchr(dir, '/') + 1);
  }
  DIR* dev = opendir("/dev");
  if (dev == NULL) return -errno;
  int status = -ENODEV;
  for (const struct dirent* entry = NULL; status < 0 && (entry = readdir(dev)) != NULL;) {
    if (strncmp(entry->d_name, "gpiochip", 8) != 0) continue;
    if (sysfs_join(path, "/dev", entry->d_name) == 0 && has_label(path, chip)) status = 0;
  }
  closedir(dev);
  return status;
}

bool gpio_is_open(const gpio_line_t* line) { return line->request != NULL; }

int gpio_wait_edge(gpio_line_t* line, int64_t deadline_ns, int64_t* edge_ns) {
  for (;;) {
    int64_t left_ns = deadline_ns - monotonic_ns();
    if (left_ns < 0) left_ns = 0;
    const struct timespec timeout = {.tv_sec = (time_t)(left_ns / 1000000000),
                                     .tv_nsec = (long)(left_ns % 1000000000)};
    struct pollfd poll_fd = {.fd = line->fd, .events = POLLIN, .revents = 0};
    const int ready = ppoll(&poll_fd, 1, &timeout, NULL);
    if (ready == 0) return 0;
    if (ready < 0) {
      if (errno == EINTR && left_ns > 0) continue;
      return errno == EINTR ? 0 : -errno;
    }
    if ((poll_fd.revents & POLLIN) == 0) return -ENODEV;
    const int count = gpio_read_edges(line, edge_ns);
    if (count <= 0) return count;
    /* Kernels before 5.7 stamp edges with CLOCK_REALTIME: then the wake-up is the best time there is. */
    const int64_t now_ns = monotonic_ns();
    if (*edge_ns > now_ns || now_ns - *edge_ns > 1000000000) *edge_ns = now_ns;
    return count;
  }
}
