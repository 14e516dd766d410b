#include "log_writer.hpp"

#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

namespace equipoise::runtime {
namespace {

constexpr std::int64_t kEventHeaderBytes = 28;  // sync, event number, time stamp, two lengths
constexpr auto kRoomCheckPeriod = std::chrono::seconds(1);

}  // namespace

std::string LogWriter::part(const std::string& path, int number) {
  if (number == 0) return path;
  const std::filesystem::path p(path);
  char middle[16];
  std::snprintf(middle, sizeof middle, ".%04d", number);
  return (p.parent_path() / (p.stem().string() + middle + p.extension().string())).string();
}

bool LogWriter::open(const std::string& path, const LogLimits& limits) {
  path_ = path;
  limits_ = limits;
  // Parts of an earlier run must not pass for this one's.
  std::error_code ignored;
  for (int i = 1; std::filesystem::remove(part(path, i), ignored); ++i) {
  }
  log_ = lcm_eventlog_create(path.c_str(), "w");
  return log_ != nullptr;
}

void LogWriter::preamble(std::int64_t utime, const std::string& channel,
                         const std::vector<std::uint8_t>& data) {
  preamble_utime_ = utime;
  preamble_channel_ = channel;
  preamble_ = data;
  write(utime, preamble_channel_.c_str(), preamble_.data(), static_cast<int>(preamble_.size()));
  tick_bytes_ = file_bytes_;
  flush();
}

void LogWriter::write(std::int64_t utime, const char* channel, std::uint8_t* data, int size) {
  if (!is_open()) return;
  lcm_eventlog_event_t event{};
  event.eventnum = event_number_++;
  event.timestamp = utime;
  event.channellen = static_cast<std::int32_t>(std::strlen(channel));
  event.datalen = size;
  event.channel = const_cast<char*>(channel);
  event.data = data;
  errno = 0;
  if (lcm_eventlog_write_event(log_, &event) != 0) {
    fail(errno);
    return;
  }
  file_bytes_ += kEventHeaderBytes + event.channellen + size;
}

void LogWriter::end_tick() {
  if (!is_open()) return;
  tick_bytes_ = file_bytes_;
  if (++pending_ticks_ >= kFlushTicks) flush();
  if (limits_.max_bytes > 0 && file_bytes_ >= limits_.max_bytes) next_file();
  if (limits_.min_free_bytes > 0) make_room();
}

void LogWriter::flush() {
  if (!is_open() || whole_bytes_ == file_bytes_) return;
  errno = 0;
  if (std::fflush(log_->f) != 0 || (limits_.sync && fdatasync(fileno(log_->f)) != 0)) {
    fail(errno);
    return;
  }
  whole_bytes_ = tick_bytes_;
  pending_ticks_ = 0;
}

void LogWriter::fail(int error) {
  if (error_.empty()) error_ = path_ + ": log stopped: " + std::strerror(error != 0 ? error : EIO);
}

/// A log on a full disk is cut back to its last whole tick.
void LogWriter::close() {
  if (log_ == nullptr) return;
  flush();
  if (error_.empty()) {
    lcm_eventlog_destroy(log_);
  } else {
    // What the buffer could not write must not be appended after the cut.
    const int fd = dup(fileno(log_->f));
    lcm_eventlog_destroy(log_);
    if (fd >= 0) {
      if (ftruncate(fd, static_cast<off_t>(whole_bytes_)) != 0) error_ += "; its last event is torn";
      ::close(fd);
    }
  }
  log_ = nullptr;
}

void LogWriter::next_file() {
  flush();
  if (!is_open()) return;
  lcm_eventlog_destroy(log_);
  log_ = lcm_eventlog_create(part(path_, ++part_).c_str(), "w");
  if (log_ == nullptr) {
    fail(errno);
    return;
  }
  file_bytes_ = tick_bytes_ = whole_bytes_ = 0;
  preamble(preamble_utime_, preamble_channel_, std::vector<std::uint8_t>(preamble_));
}

void LogWriter::make_room() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_room_check_) return;
  next_room_check_ = now + kRoomCheckPeriod;
  struct statvfs disk {};
  while (fstatvfs(fileno(log_->f), &disk) == 0 &&
         static_cast<std::int64_t>(disk.f_bavail) * static_cast<std::int64_t>(disk.f_frsize) <
             limits_.min_free_bytes) {
    if (oldest_part_ == part_) {
      flush();
      fail(ENOSPC);
      return;
    }
    std::error_code ignored;
    std::filesystem::remove(part(path_, oldest_part_++), ignored);
  }
}

}  // namespace equipoise::runtime
