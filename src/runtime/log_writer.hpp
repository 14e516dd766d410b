// An LCM event log that survives: whole ticks per write, cut back to its last whole tick when the disk is
// full, continued in a further file when it is large, oldest files deleted when space is short. A log that
// another process is writing is left alone.
// In: events -> out: NAME.lcm, NAME.0001.lcm, ...; each starts with the preamble. What write() took survives
// SIGKILL; a thread of its own brings it to the disk for a power cut. Telemetry thread only.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "equipoise/no_copy.hpp"

namespace equipoise::runtime {

struct LogLimits {
  std::int64_t max_bytes = 0;       // of one file; 0: no limit
  std::int64_t min_free_bytes = 0;  // on its file system
  bool sync = false;                // to the disk, not only to the kernel
  bool keep_previous = false;       // a log of the same name is moved aside rather than replaced
};

class LogWriter : NoCopy {
 public:
  ~LogWriter() { close(); }

  /// False when the file cannot be created; error() says why.
  bool open(const std::string& path, const LogLimits& limits);
  bool is_open() const { return fd_ >= 0 && error_.empty(); }
  const std::string& error() const { return error_; }

  /// Repeated at the start of every further file.
  void preamble(std::int64_t utime, std::string_view channel, const std::vector<std::uint8_t>& data);
  void event(std::int64_t utime, std::string_view channel, const std::vector<std::uint8_t>& data);
  /// The tick's events go to the kernel, all or none; where more follow at once, with theirs.
  void end_tick(bool more = false);
  void close();

 private:
  void fail(int error);
  bool create(const std::string& path);
  void write_out();
  void make_room();
  void next_file();
  void sync_periodically();

  std::string path_;
  LogLimits limits_;
  int fd_ = -1;
  std::string error_;
  std::string preamble_channel_;
  std::vector<std::uint8_t> preamble_;
  std::int64_t preamble_utime_ = 0;
  std::vector<std::uint8_t> ticks_;  // their events, the first `used_` bytes
  std::size_t used_ = 0;
  int part_ = 0;
  std::deque<std::string> files_;  // of this run, oldest first
  std::int64_t event_number_ = 0;
  std::int64_t file_bytes_ = 0;  // whole ticks, in the kernel
  std::chrono::steady_clock::time_point next_room_check_{};
  std::thread syncer_;
  std::atomic<int> sync_fd_{-1};
  std::atomic<int> sync_error_{0};
  std::atomic<bool> sync_stop_{false};
};

}  // namespace equipoise::runtime
