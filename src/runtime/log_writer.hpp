// An LCM event log that survives: whole ticks, written through every few of them, cut back to its last whole
// tick when the disk is full, continued in a further file when it is large, oldest files deleted when space
// is short. In: events -> out: NAME.lcm, NAME.0001.lcm, ...; each starts with the preamble. Telemetry thread
// only.
#pragma once

#include <lcm/eventlog.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace equipoise::runtime {

struct LogLimits {
  std::int64_t max_bytes = 0;       // of one file; 0: no limit
  std::int64_t min_free_bytes = 0;  // on its file system
  bool sync = false;                // to the disk, not only to the kernel
};

class LogWriter {
 public:
  LogWriter() = default;
  ~LogWriter() { close(); }
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /// False with errno set when the file cannot be created.
  bool open(const std::string& path, const LogLimits& limits);
  bool is_open() const { return log_ != nullptr && error_.empty(); }
  const std::string& error() const { return error_; }

  /// Repeated at the start of every further file.
  void preamble(std::int64_t utime, const std::string& channel, const std::vector<std::uint8_t>& data);
  void write(std::int64_t utime, const char* channel, std::uint8_t* data, int size);
  void end_tick();
  void flush();
  void close();

  /// NAME.lcm, 3 -> NAME.0003.lcm; 0 is NAME.lcm itself.
  static std::string part(const std::string& path, int number);

 private:
  void fail(int error);
  void make_room();
  void next_file();

  static constexpr int kFlushTicks = 10;  // 50 ms

  std::string path_;
  LogLimits limits_;
  lcm_eventlog_t* log_ = nullptr;
  std::string error_;
  std::string preamble_channel_;
  std::vector<std::uint8_t> preamble_;
  std::int64_t preamble_utime_ = 0;
  int part_ = 0;
  int oldest_part_ = 0;
  std::int64_t event_number_ = 0;
  std::int64_t file_bytes_ = 0;   // handed to the file
  std::int64_t tick_bytes_ = 0;   // of them, up to the last whole tick
  std::int64_t whole_bytes_ = 0;  // of them, known to be in the kernel
  int pending_ticks_ = 0;
  std::chrono::steady_clock::time_point next_room_check_{};
};

}  // namespace equipoise::runtime
