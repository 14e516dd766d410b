// SIGINT and SIGTERM as a flag that loops poll. Process-wide.
#pragma once

#include <atomic>
#include <csignal>

namespace equipoise::app {

inline std::atomic<bool> interrupted{false};

inline void watch_interrupts() {
  const auto handler = [](int) { interrupted.store(true); };
  std::signal(SIGINT, handler);
  std::signal(SIGTERM, handler);
}

}  // namespace equipoise::app
