// An event of given bytes into a log.
#pragma once

#include <algorithm>
#include <string_view>
#include <vector>

#include "runtime/log_writer.hpp"

namespace equipoise::runtime {

inline void write_event(LogWriter* log, std::int64_t utime, std::string_view channel,
                        const std::vector<std::uint8_t>& data) {
  std::copy(data.begin(), data.end(), log->event(utime, channel, data.size()));
}

}  // namespace equipoise::runtime
