// The files of one log. NAME.lcm goes on in NAME.0001.lcm, NAME.0002.lcm, ...; the first of them are deleted
// when space is short. In: path -> out: paths. Not for the tick.
#pragma once

#include <cstdint>
#include <ctime>
#include <string>
#include <string_view>
#include <vector>

namespace equipoise::runtime {

/// What each event of an LCM log begins with.
inline constexpr std::string_view kLogSync("\xED\xA1\xDA\x01", 4);

/// A moment of Unix time, as the names of logs have it: 20261122T014503Z.
inline std::string utc_text(std::int64_t time_s, const char* format = "%Y%m%dT%H%M%SZ") {
  const auto time = static_cast<std::time_t>(time_s);
  std::tm utc{};
  gmtime_r(&time, &utc);
  char text[32];
  (void)std::strftime(text, sizeof text, format, &utc);
  return text;
}

/// NAME.lcm, 3 -> NAME.0003.lcm; 0 is NAME.lcm itself.
std::string log_part(const std::string& path, int number);
/// Back: which part of the log `path` the file `part` is.
int log_part_number(const std::string& path, const std::string& part);

/// Those that exist, in order; `path` itself need not.
std::vector<std::string> existing_log_parts(const std::string& path);

/// False for a file that something else has written.
bool is_log_or_empty(const std::string& path);

/// Logs of this name that were moved aside when a later one took it, oldest first, with all their parts.
std::vector<std::string> kept_logs(const std::string& path);

/// The name for a log of `path` that is moved aside and ended at `time_s` (Unix): NAME.20261122T014503Z.lcm.
std::string kept_name(const std::string& path, std::int64_t time_s);

}  // namespace equipoise::runtime
