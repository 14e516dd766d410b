#include <fcntl.h>
#include <unistd.h>

#include <stdexcept>

#include "app/guard/guard.hpp"
#include "app/text/errors.hpp"
#include "sysfs.h"

namespace equipoise::app {
namespace {

int open_attribute(const std::string& path) {
  const int fd = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (fd < 0) throw InputError(path + ": cannot be opened for writing by the guard");
  return fd;
}

}  // namespace

BoardBridges::BoardBridges(const bbb_config_t& config) {
  bbb_error_t error{};
  if (cutoff_open(&cutoff_, &config, &error) != 0) throw std::runtime_error(error.text);
}

FileBridges::FileBridges(const std::string& enable, const std::vector<std::string>& pwm) {
  if (!enable.empty()) enable_fd_ = open_attribute(enable);
  for (const std::string& path : pwm) pwm_fds_.push_back(open_attribute(path));
}

FileBridges::~FileBridges() {
  (void)off();
  if (enable_fd_ >= 0) close(enable_fd_);
  for (const int fd : pwm_fds_) close(fd);
}

int FileBridges::enable() noexcept { return enable_fd_ >= 0 ? sysfs_write_u32(enable_fd_, 1) : 0; }

int FileBridges::off() noexcept {
  int status = enable_fd_ >= 0 ? sysfs_write_u32(enable_fd_, 0) : 0;
  for (const int fd : pwm_fds_) {
    const int next = sysfs_write_u32(fd, 0);
    if (status == 0) status = next;
  }
  return status;
}

}  // namespace equipoise::app
