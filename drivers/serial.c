#include "serial.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "sysfs.h"

static int speed_of(uint32_t baud, speed_t* out) {
  static const struct {
    uint32_t baud;
    speed_t speed;
  } kSpeeds[] = {{1200, B1200},   {2400, B2400},   {4800, B4800},   {9600, B9600},
                 {19200, B19200}, {38400, B38400}, {57600, B57600}, {115200, B115200}};
  for (size_t i = 0; i < sizeof kSpeeds / sizeof *kSpeeds; ++i) {
    if (kSpeeds[i].baud == baud) {
      *out = kSpeeds[i].speed;
      return 0;
    }
  }
  return -EINVAL;
}

/* UART1 is ttyS1, ttyO1 or, where only it is enabled, ttyS0: its address says which. */
static int path_of(char out[SYSFS_PATH_MAX], const char* port) {
  if (port[0] == '/') {
    const int n = snprintf(out, SYSFS_PATH_MAX, "%s", port);
    return n >= SYSFS_PATH_MAX ? -ENAMETOOLONG : 0;
  }
  char dir[SYSFS_PATH_MAX];
  const int status = sysfs_find("/sys/class/tty", "tty", port, dir);
  return status < 0 ? status : sysfs_join(out, "/dev", strrchr(dir, '/') + 1);
}

int serial_open(serial_t* serial, const char* port, uint32_t baud) {
  serial->fd = -1;
  speed_t speed = B0;
  if (speed_of(baud, &speed) < 0) return -EINVAL;
  char path[SYSFS_PATH_MAX];
  const int found = path_of(path, port);
  if (found < 0) return found;
  serial->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (serial->fd < 0) return -errno;
  struct termios raw;
  int status = tcgetattr(serial->fd, &raw);
  if (status == 0) {
    cfmakeraw(&raw); /* 8N1, no echo, no translation */
    raw.c_cflag |= CLOCAL | CREAD;
    raw.c_cflag &= (tcflag_t) ~(CSTOPB | CRTSCTS);
    raw.c_cc[VMIN] = 1; /* with O_NONBLOCK: -EAGAIN for "nothing", 0 only for "gone" */
    raw.c_cc[VTIME] = 0;
    status = cfsetspeed(&raw, speed);
  }
  if (status == 0) status = tcsetattr(serial->fd, TCSANOW, &raw);
  if (status == 0) status = tcflush(serial->fd, TCIOFLUSH);
  if (status == 0) return 0;
  status = -errno;
  serial_close(serial);
  return status;
}

int serial_read(const serial_t* serial, uint8_t* out, size_t size) {
  const ssize_t n = read(serial->fd, out, size);
  if (n < 0) return -errno;
  return n == 0 && size > 0 ? -EIO : (int)n;
}

int serial_write(const serial_t* serial, const uint8_t* data, size_t size) {
  const ssize_t n = write(serial->fd, data, size);
  return n < 0 ? -errno : (int)n;
}

void serial_close(serial_t* serial) {
  if (serial->fd >= 0) close(serial->fd);
  serial->fd = -1;
}
