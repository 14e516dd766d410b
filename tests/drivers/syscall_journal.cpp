#include "syscall_journal.hpp"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <string.h>
#include <unistd.h>

#include <climits>

SyscallJournal& SyscallJournal::instance() {
  static SyscallJournal journal;
  return journal;
}

void SyscallJournal::clear() {
  lines_.clear();
  failures_.clear();
  answers_.clear();
  open_.clear();
  stray_closes_ = 0;
  inheritable_ = 0;
}

void SyscallJournal::failRead(const std::string& path_end, int error, int times) {
  failures_.push_back({Call::kRead, path_end, error, times});
}

void SyscallJournal::failWrite(const std::string& path_end, int error, int times) {
  failures_.push_back({Call::kWrite, path_end, error, times});
}

void SyscallJournal::failOpen(const std::string& path_end, int error, int times) {
  failures_.push_back({Call::kOpen, path_end, error, times});
}

void SyscallJournal::onWrite(const std::string& path_end, std::function<void()> answer) {
  answers_.emplace_back(path_end, std::move(answer));
}

namespace {
bool endsWith(const std::string& path, const std::string& end) {
  return path.size() >= end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0;
}
}  // namespace

bool SyscallJournal::takeFailure(Call call, const std::string& path, int* error) {
  for (Failure& failure : failures_) {
    if (failure.call != call || failure.times == 0 || !endsWith(path, failure.path_end)) continue;
    --failure.times;
    *error = failure.error;
    return true;
  }
  return false;
}

void SyscallJournal::written(const std::string& path) const {
  for (const auto& [path_end, answer] : answers_) {
    if (endsWith(path, path_end)) answer();
  }
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

int kept_stdin = -1;        // while a NoStdin lives: where standard input waits
bool zero_is_node = false;  // and descriptor 0 is a device that umockdev emulates
}  // namespace

extern "C" {
int __real_open64(const char* path, int flags, ...);
int __real_close(int fd);

int __wrap_open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  SyscallJournal& journal = SyscallJournal::instance();
  if (journal.takeFailure(SyscallJournal::Call::kOpen, path, &errno)) return -1;
  const bool zero_is_free = kept_stdin >= 0 && !journal.isOpen(STDIN_FILENO);
  // umockdev knows its nodes in /dev by the descriptor that they were opened with; the others can be moved to
  // 0, which leaves no moment in which one of its threads could take 0.
  const bool is_node = strncmp(path, "/dev/", 5) == 0;
  if (zero_is_free && is_node) __real_close(STDIN_FILENO);
  int fd = __real_open64(path, flags, mode);
  const int error = errno;
  if (zero_is_free && is_node && fd < 0) dup2(kept_stdin, STDIN_FILENO);
  if (zero_is_free && !is_node && fd > 0) {
    dup2(fd, STDIN_FILENO);
    __real_close(fd);
    fd = STDIN_FILENO;
  }
  if (fd == STDIN_FILENO) zero_is_node = is_node;
  if (fd >= 0) journal.opened(fd, path);
  if (fd >= 0 && (flags & O_CLOEXEC) == 0) journal.openedInheritable();
  errno = error;
  return fd;
}

int __wrap_close(int fd) {
  SyscallJournal::instance().closed(fd);
  if (kept_stdin < 0 || fd != STDIN_FILENO) return __real_close(fd);
  if (zero_is_node) __real_close(fd);
  return dup2(kept_stdin, STDIN_FILENO) < 0 ? -1 : 0;
}

ssize_t __real_pread64(int fd, void* data, size_t size, off64_t at);
ssize_t __real_pwrite64(int fd, const void* data, size_t size, off64_t at);

ssize_t __wrap_pread64(int fd, void* data, size_t size, off64_t at) {
  int error = 0;
  if (!SyscallJournal::instance().takeFailure(SyscallJournal::Call::kRead, pathOf(fd), &error))
    return __real_pread64(fd, data, size, at);
  errno = error;
  return error == 0 ? 0 : -1;
}

ssize_t __real_read(int fd, void* data, size_t size);

ssize_t __wrap_read(int fd, void* data, size_t size) {
  int error = 0;
  if (!SyscallJournal::instance().takeFailure(SyscallJournal::Call::kRead, pathOf(fd), &error))
    return __real_read(fd, data, size);
  errno = error;
  return error == 0 ? 0 : -1;
}

ssize_t __wrap_pwrite64(int fd, const void* data, size_t size, off64_t at) {
  const std::string path = pathOf(fd);
  int error = 0;
  if (SyscallJournal::instance().takeFailure(SyscallJournal::Call::kWrite, path, &error)) {
    errno = error;
    return error == 0 ? 0 : -1;
  }
  SyscallJournal::instance().note(describe(path, data, size));
  const ssize_t done = __real_pwrite64(fd, data, size, at);
  SyscallJournal::instance().written(path);
  return done;
}
}

NoStdin::NoStdin() {
  if (fcntl(STDIN_FILENO, F_GETFD) < 0) __real_open64("/dev/null", O_RDONLY);
  kept_stdin = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 100);
}

NoStdin::~NoStdin() {
  dup2(kept_stdin, STDIN_FILENO);
  __real_close(kept_stdin);
  kept_stdin = -1;
}
