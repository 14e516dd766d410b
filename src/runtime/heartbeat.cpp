#include "equipoise/runtime/heartbeat.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>

namespace equipoise::runtime {
namespace {

constexpr off_t kSize = sizeof(HeartbeatPage);
constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

[[noreturn]] void fail(int fd, const std::string& what) {
  if (fd >= 0) close(fd);
  throw std::runtime_error("heartbeat page: " + what);
}

/// Memory is taken now: a machine without any says so here and not with a signal in the loop.
int create() {
  const int fd = memfd_create("equipoise-heartbeat", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (fd < 0) fail(fd, std::string("no shared memory: ") + std::strerror(errno));
  if (fchmod(fd, 0600) != 0 || fallocate(fd, 0, 0, kSize) != 0 || fcntl(fd, F_ADD_SEALS, kSeals) != 0)
    fail(fd, std::string("no memory for it: ") + std::strerror(errno));
  return fd;
}

int checked(int fd) {
  struct stat status {};
  if (fstat(fd, &status) != 0) fail(-1, std::string("descriptor: ") + std::strerror(errno));
  const int seals = fcntl(fd, F_GET_SEALS);
  if (status.st_nlink != 0 || seals < 0 || (seals & kSeals) != kSeals || status.st_size != kSize)
    fail(fd, "the descriptor is not of sealed anonymous memory of its size");
  if (status.st_uid != geteuid() || (status.st_mode & 077U) != 0)
    fail(fd, "the descriptor's memory is open to another user");
  return fd;
}

}  // namespace

SharedHeartbeat::SharedHeartbeat() : fd_(create()) {
  map();
  page_ = new (page_) HeartbeatPage{};
  page_->magic.store(HeartbeatPage::kMagic, std::memory_order_release);
}

SharedHeartbeat::SharedHeartbeat(int fd) : fd_(checked(fd)) {
  map();
  if (page_->magic.load(std::memory_order_acquire) == HeartbeatPage::kMagic) return;
  munmap(page_, sizeof(HeartbeatPage));
  fail(fd_, "something else is in the descriptor's memory");
}

void SharedHeartbeat::map() {
  void* const memory = mmap(nullptr, sizeof(HeartbeatPage), PROT_READ | PROT_WRITE, MAP_SHARED, fd_, 0);
  if (memory == MAP_FAILED) fail(fd_, std::string("cannot be mapped: ") + std::strerror(errno));
  page_ = static_cast<HeartbeatPage*>(memory);
}

SharedHeartbeat::~SharedHeartbeat() {
  munmap(page_, sizeof(HeartbeatPage));
  close(fd_);
}

}  // namespace equipoise::runtime
