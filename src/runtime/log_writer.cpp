#include "log_writer.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "equipoise/runtime/big_endian.hpp"
#include "equipoise/runtime/log_parts.hpp"

namespace equipoise::runtime {
namespace {

constexpr std::uint32_t kSync = 0xEDA1DA01U;
constexpr std::size_t kHeaderBytes = 28;        // sync, number, time, two lengths
constexpr std::size_t kWriteBytes = 1U << 14U;  // some ten ticks
constexpr auto kRoomCheckPeriod = std::chrono::seconds(1);
constexpr auto kSyncPeriod = std::chrono::milliseconds(50);

/// 0, or errno: EWOULDBLOCK where another process writes it, for which it holds a lock.
int end_of_writing(const std::string& part, std::int64_t* time_s) {
  const int fd = open(part.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return errno;
  struct stat status {};
  const int error = fstat(fd, &status) == 0 && flock(fd, LOCK_EX | LOCK_NB) == 0 ? 0 : errno;
  close(fd);
  *time_s = status.st_mtim.tv_sec;
  return error;
}

/// The earlier log of this name gets out of the way. 0, or errno.
int clear_name(const std::string& path, bool keep) {
  const std::vector<std::string> parts = existing_log_parts(path);
  std::int64_t ended_s = 0;
  for (const std::string& part : parts) {
    if (const int error = end_of_writing(part, &ended_s)) return error;
  }
  const std::string kept = kept_name(path, ended_s);
  for (const std::string& part : parts) {
    const int error = keep ? rename(part.c_str(), log_part(kept, log_part_number(path, part)).c_str())
                           : unlink(part.c_str());
    if (error != 0) return errno;
  }
  return 0;
}

bool is_regular_or_absent(const std::string& path) {
  std::error_code error;
  const auto type = std::filesystem::status(path, error).type();
  return type == std::filesystem::file_type::regular || type == std::filesystem::file_type::not_found;
}

}  // namespace

bool LogWriter::create(const std::string& path) {
  // Not waiting for somebody to read a pipe, but waiting for him to read on.
  const int flags = O_WRONLY | O_CREAT | O_CLOEXEC | O_NONBLOCK | (is_regular_or_absent(path) ? O_EXCL : 0);
  const int fd = ::open(path.c_str(), flags, 0644);
  if (fd >= 0) fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) & ~O_NONBLOCK);
  if (fd < 0 && errno == ENXIO) {
    error_ = path + ": log cannot be created: is a pipe without a reader";
    return false;
  }
  if (fd < 0 || ((flags & O_EXCL) != 0 && flock(fd, LOCK_EX | LOCK_NB) != 0)) {
    error_ = path + ": log cannot be created: " + std::strerror(errno);
    if (fd >= 0) ::close(fd);
    return false;
  }
  fd_ = fd;
  files_.push_back(path);
  file_bytes_ = 0;
  sync_fd_.store(fd, std::memory_order_relaxed);
  return true;
}

bool LogWriter::open(const std::string& path, const LogLimits& limits) {
  path_ = path;
  limits_ = limits;
  if (is_regular_or_absent(path) && !existing_log_parts(path).empty()) {
    if (std::filesystem::exists(path) && !is_log_or_empty(path)) {
      error_ = path + ": exists and is no log; choose another name";
      return false;
    }
    const int error = clear_name(path, limits.keep_previous);
    if (error != 0) {
      error_ = path + ": log cannot be created: " +
               (error == EWOULDBLOCK ? "another process is writing it" : std::strerror(error));
      return false;
    }
  }
  if (!create(path)) return false;
  if (limits_.sync) syncer_ = std::thread([this] { sync_periodically(); });
  return true;
}

void LogWriter::preamble(std::int64_t utime, std::string_view channel,
                         const std::vector<std::uint8_t>& data) {
  preamble_utime_ = utime;
  preamble_channel_ = channel;
  preamble_ = data;
  event(utime, channel, data);
  write_out();
}

void LogWriter::event(std::int64_t utime, std::string_view channel, const std::vector<std::uint8_t>& data) {
  const std::size_t before = used_;
  used_ += kHeaderBytes + channel.size() + data.size();
  if (used_ > ticks_.size()) ticks_.resize(2 * used_);
  std::uint8_t* at = ticks_.data() + before;
  at = store_big_endian(kSync, at);
  at = store_big_endian(static_cast<std::uint64_t>(event_number_++), at);
  at = store_big_endian(static_cast<std::uint64_t>(utime), at);
  at = store_big_endian(static_cast<std::uint32_t>(channel.size()), at);
  at = store_big_endian(static_cast<std::uint32_t>(data.size()), at);
  at = std::copy(channel.begin(), channel.end(), at);
  std::copy(data.begin(), data.end(), at);
}

void LogWriter::end_tick(bool more) {
  if (more && used_ < kWriteBytes) return;
  write_out();
  if (const int error = sync_error_.load(std::memory_order_relaxed)) fail(error);
  if (!is_open()) return;
  if (limits_.max_bytes > 0 && file_bytes_ >= limits_.max_bytes) next_file();
  if (limits_.min_free_bytes > 0) make_room();
}

void LogWriter::write_out() {
  std::size_t done = 0;
  while (is_open() && done < used_) {
    const ssize_t written = ::write(fd_, ticks_.data() + done, used_ - done);
    if (written > 0) {
      done += static_cast<std::size_t>(written);
    } else if (written == 0 || errno != EINTR) {
      fail(written == 0 ? ENOSPC : errno);
      if (done > 0 && ftruncate(fd_, static_cast<off_t>(file_bytes_)) != 0)
        error_ += "; its last event is torn";
    }
  }
  if (is_open()) file_bytes_ += static_cast<std::int64_t>(done);
  used_ = 0;
}

void LogWriter::fail(int error) {
  if (error_.empty()) error_ = path_ + ": log stopped: " + std::strerror(error);
}

void LogWriter::close() {
  if (syncer_.joinable()) {
    sync_stop_.store(true, std::memory_order_relaxed);
    syncer_.join();
  }
  const int fd = fd_;
  if (fd < 0) return;
  write_out();
  if (limits_.sync && fdatasync(fd) != 0) fail(errno);
  struct stat status {};
  if (error_.empty() && fstat(fd, &status) == 0 && status.st_nlink == 0)
    error_ = files_.back() + ": the log was deleted while it was written";
  ::close(fd);
  fd_ = -1;
}

/// fdatasync may take longer than a tick; here nobody waits for it.
void LogWriter::sync_periodically() {
  while (!sync_stop_.load(std::memory_order_relaxed)) {
    if (fdatasync(sync_fd_.load(std::memory_order_relaxed)) != 0 && errno != EBADF)  // EBADF: just rotated
      sync_error_.store(errno, std::memory_order_relaxed);
    std::this_thread::sleep_for(kSyncPeriod);
  }
}

void LogWriter::next_file() {
  const int previous = fd_;
  do {
    ++part_;
  } while (std::filesystem::exists(log_part(path_, part_)));  // whoever's that is
  if (!create(log_part(path_, part_))) return;
  if (limits_.sync) (void)fdatasync(previous);
  ::close(previous);
  preamble(preamble_utime_, preamble_channel_, std::vector<std::uint8_t>(preamble_));
}

/// Earlier logs of this name go first, then this run's own oldest files.
void LogWriter::make_room() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_room_check_) return;
  next_room_check_ = now + kRoomCheckPeriod;
  std::vector<std::string> kept;
  bool looked = false;
  struct statvfs disk {};
  while (fstatvfs(fd_, &disk) == 0 &&
         static_cast<std::int64_t>(disk.f_bavail) * static_cast<std::int64_t>(disk.f_frsize) <
             limits_.min_free_bytes) {
    if (!looked) kept = kept_logs(path_);
    looked = true;
    std::error_code ignored;
    if (!kept.empty()) {
      std::filesystem::remove(kept.front(), ignored);
      kept.erase(kept.begin());
    } else if (files_.size() == 1) {
      fail(ENOSPC);
      return;
    } else {
      std::filesystem::remove(files_.front(), ignored);
      files_.pop_front();
    }
  }
}

}  // namespace equipoise::runtime
