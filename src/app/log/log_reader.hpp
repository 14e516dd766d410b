// Reads LCM event logs, also cut off or damaged ones. In: bytes of a file -> out: its whole events, in order,
// and how many bytes belong to none. Not for the tick.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace equipoise::app {

struct LogEvent {
  std::int64_t utime = 0;
  std::string_view channel;
  std::string_view data;
};

class LogReader {
 public:
  /// The bytes must outlive the reader.
  explicit LogReader(std::string_view bytes) : bytes_(bytes) {}

  /// False at the end.
  bool next(LogEvent* event);
  /// Left out so far: damage, or a torn end.
  std::size_t damaged_bytes() const { return damaged_; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
  std::size_t damaged_ = 0;
};

/// All parts of a run, NAME.lcm, NAME.0001.lcm, ... in one string; InputError when there is none.
std::string read_log_parts(const std::string& path);

}  // namespace equipoise::app
