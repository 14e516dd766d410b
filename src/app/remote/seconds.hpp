// The monotonic clock in seconds, for waits and silences. Not for ticks.
#pragma once

#include <chrono>

namespace equipoise::app {

inline double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace equipoise::app
