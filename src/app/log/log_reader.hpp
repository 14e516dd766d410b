// Reads LCM event logs, also cut off or damaged ones, in bounded memory. In: path of a log, all of whose
// parts are read in order, or bytes -> out: its whole events, and how many bytes belong to none. Not for the
// tick.
#pragma once

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "app/cli/progress.hpp"

namespace equipoise::app {

struct LogEvent {  // valid until the next one is read
  std::int64_t utime = 0;
  std::string_view channel;
  std::string_view data;
};

class LogReader {
 public:
  /// InputError when there is no such file.
  static LogReader open(const std::string& path);
  static LogReader over(std::string bytes);

  /// False at the end.
  bool next(LogEvent* event);
  /// Shows how far it is, as "WHAT: 12 %".
  void show_progress(const std::string& what);
  /// Left out so far: damage, or a torn end.
  std::size_t damaged_bytes() const { return damaged_; }

 private:
  LogReader() = default;
  bool has(std::size_t bytes);
  bool next_part();
  void skip_to_sync();

  std::vector<std::string> parts_;
  std::size_t next_part_ = 0;
  std::ifstream file_;
  std::string buffer_;
  std::unique_ptr<Progress> progress_;
  double total_bytes_ = 0.0;  // of all parts
  double read_bytes_ = 0.0;
  std::size_t at_ = 0;
  std::size_t damaged_ = 0;
};

}  // namespace equipoise::app
