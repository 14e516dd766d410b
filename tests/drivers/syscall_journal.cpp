#include "syscall_journal.hpp"

#include <errno.h>
#include <unistd.h>

#include <climits>

SyscallJournal& SyscallJournal::instance() {
  static SyscallJournal journal;
  return journal;
}

void SyscallJournal::clear() {
  lines_.clear();
  failures_.clear();
}

void SyscallJournal::failRead(const std::string& path_end, int error, int times) {
  failures_.push_back({false, path_end, error, times});
}

void SyscallJournal::failWrite(const std::string& path_end, int error, int times) {
  failures_.push_back({true, path_end, error, times});
}

bool SyscallJournal::takeFailure(bool write, const std::string& path, int* error) {
  for (Failure& failure : failures_) {
    const std::string& end = failure.path_end;
    if (failure.write != write || failure.times == 0 || path.size() < end.size()) continue;
    if (path.compare(path.size() - end.size(), end.size(), end) != 0) continue;
    --failure.times;
    *error = failure.error;
    return true;
  }
  return false;
}

namespace {
std::string pathOf(int fd) {
  char link[64];
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  char path[PATH_MAX];
  const ssize_t n = readlink(link, path, sizeof path);
  return n > 0 ? std::string(path, static_cast<size_t>(n)) : std::string();
}

// "pwm0/duty_cycle=0": the last two components and the text.
std::string describe(const std::string& path, const void* data, size_t size) {
  size_t cut = path.rfind('/');
  if (cut != std::string::npos && cut > 0) cut = path.rfind('/', cut - 1);
  std::string text(static_cast<const char*>(data), size);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return (cut == std::string::npos ? path : path.substr(cut + 1)) + "=" + text;
}
}  // namespace

extern "C" {
ssize_t __real_pread64(int fd, void* data, size_t size, off64_t at);
ssize_t __real_pwrite64(int fd, const void* data, size_t size, off64_t at);

ssize_t __wrap_pread64(int fd, void* data, size_t size, off64_t at) {
  int error = 0;
  if (!SyscallJournal::instance().takeFailure(false, pathOf(fd), &error))
    return __real_pread64(fd, data, size, at);
  errno = error;
  return error == 0 ? 0 : -1;
}

ssize_t __wrap_pwrite64(int fd, const void* data, size_t size, off64_t at) {
  const std::string path = pathOf(fd);
  int error = 0;
  if (SyscallJournal::instance().takeFailure(true, path, &error)) {
    errno = error;
    return error == 0 ? 0 : -1;
  }
  SyscallJournal::instance().note(describe(path, data, size));
  return __real_pwrite64(fd, data, size, at);
}
}
