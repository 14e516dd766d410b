#include "equipoise/runtime/heartbeat.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <stdexcept>

namespace equipoise::runtime {

SharedHeartbeat::SharedHeartbeat(const std::string& name, Role role) : name_(name), role_(role) {
  const bool create = role == Role::kGuard;
  // Owner and group only: whoever can write here can keep the motors on.
  if (create) shm_unlink(name.c_str());
  const int fd =
      shm_open(name.c_str(), create ? O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC : O_RDWR | O_CLOEXEC, 0660);
  const auto fail = [&](const std::string& what) {
    const int error = errno;
    if (fd >= 0) close(fd);
    throw std::runtime_error("heartbeat " + name + ": " + what + ": " + std::strerror(error));
  };
  if (fd < 0) fail(create ? "cannot be created" : "cannot be opened (is equipoise guard running?)");
  if (create && ftruncate(fd, sizeof(HeartbeatPage)) != 0) fail("cannot be sized");
  struct stat status {};
  if (fstat(fd, &status) != 0 || status.st_size < static_cast<off_t>(sizeof(HeartbeatPage))) {
    errno = EBADMSG;
    fail("is not a heartbeat page");
  }
  void* memory = mmap(nullptr, sizeof(HeartbeatPage), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (memory == MAP_FAILED) fail("cannot be mapped");
  close(fd);
  if (create) {
    page_ = new (memory) HeartbeatPage{};
    page_->magic.store(HeartbeatPage::kMagic, std::memory_order_release);
  } else {
    page_ = static_cast<HeartbeatPage*>(memory);
    if (page_->magic.load(std::memory_order_acquire) != HeartbeatPage::kMagic) {
      munmap(memory, sizeof(HeartbeatPage));
      throw std::runtime_error("heartbeat " + name + ": is not a heartbeat page");
    }
  }
}

SharedHeartbeat::~SharedHeartbeat() {
  munmap(page_, sizeof(HeartbeatPage));
  if (role_ == Role::kGuard) shm_unlink(name_.c_str());
}

}  // namespace equipoise::runtime
