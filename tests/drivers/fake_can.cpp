#include "fake_can.hpp"

#include <errno.h>
#include <fcntl.h>
#include <linux/can/raw.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>

#include "syscall_journal.hpp"

FakeCan& FakeCan::instance() {
  static FakeCan can;
  return can;
}

namespace {
FakeCan& fake() { return FakeCan::instance(); }

int answer(int error) {
  errno = error;
  return error == 0 ? 0 : -1;
}
}  // namespace

extern "C" {
int __real_socket(int domain, int type, int protocol);
int __real_ioctl(int fd, unsigned long request, void* data);
int __real_setsockopt(int fd, int level, int name, const void* value, socklen_t size);
int __real_bind(int fd, const sockaddr* address, socklen_t size);

int __wrap_socket(int domain, int type, int protocol) {
  if (!fake().plays || domain != PF_CAN) return __real_socket(domain, type, protocol);
  fake().type = type;
  fake().protocol = protocol;
  if (answer(fake().socket_error) < 0) return -1;
  fake().fd = open("/dev/null", O_RDWR);
  SyscallJournal::instance().opened(fake().fd);
  return fake().fd;
}

int __wrap_ioctl(int fd, unsigned long request, ...) {
  va_list rest;
  va_start(rest, request);
  void* const data = va_arg(rest, void*);
  va_end(rest);
  if (!fake().plays || fd != fake().fd) return __real_ioctl(fd, request, data);
  ifreq* const about = static_cast<ifreq*>(data);
  if (request == SIOCGIFINDEX) {
    fake().interface.assign(about->ifr_name, strnlen(about->ifr_name, sizeof about->ifr_name));
    about->ifr_ifindex = 42;
    return answer(fake().index_error);
  }
  about->ifr_flags = fake().flags;
  return answer(request == SIOCGIFFLAGS ? fake().flags_error : ENOTTY);
}

int __wrap_setsockopt(int fd, int level, int name, const void* value, socklen_t size) {
  if (!fake().plays || fd != fake().fd) return __real_setsockopt(fd, level, name, value, size);
  if (level != SOL_CAN_RAW || name != CAN_RAW_ERR_FILTER || size != sizeof fake().errors)
    return answer(ENOPROTOOPT);
  memcpy(&fake().errors, value, sizeof fake().errors);
  return answer(fake().option_error);
}

int __wrap_bind(int fd, const sockaddr* address, socklen_t size) {
  if (!fake().plays || fd != fake().fd) return __real_bind(fd, address, size);
  memcpy(&fake().address, address, std::min<size_t>(size, sizeof fake().address));
  return answer(fake().bind_error);
}
}
