#include "events.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

int events_open(events_t* events, const char* path) {
  events->fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  return events->fd < 0 ? -errno : 0;
}

int events_next(const events_t* events, struct input_event* out) {
  const ssize_t n = read(events->fd, out, sizeof *out);
  if (n < 0) return errno == EINTR ? -EAGAIN : -errno;
  return n == (ssize_t)sizeof *out ? 0 : -ENODEV; /* the kernel and a pipe give whole records or none */
}

int events_axis(const events_t* events, uint16_t code, struct input_absinfo* out) {
  return ioctl(events->fd, EVIOCGABS((unsigned)code), out) < 0 ? -errno : 0;
}

int events_wait(const events_t* events, int milliseconds) {
  struct pollfd ready = {.fd = events->fd, .events = POLLIN, .revents = 0};
  return poll(&ready, 1, milliseconds) > 0;
}

void events_close(events_t* events) {
  if (events->fd >= 0) close(events->fd);
  events->fd = -1;
}
