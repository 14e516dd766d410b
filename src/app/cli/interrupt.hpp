// SIGINT, SIGTERM and SIGHUP as a flag that loops poll. Process-wide.
#pragma once

#include <atomic>
#include <csignal>

#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {

inline std::atomic<bool> interrupted{false};
inline std::atomic<std::int64_t> interrupted_ns{0};

/// A second signal ends a process that hangs when the first should have ended it long ago: its terminal may
/// be stopped.
inline void watch_interrupts() {
  const auto handler = [](int number) {
    constexpr std::int64_t kPatience_ns = 2'000'000'000;
    const std::int64_t now_ns = runtime::monotonic_now_ns();
    if (!interrupted.exchange(true)) {
      interrupted_ns.store(now_ns);
    } else if (now_ns - interrupted_ns.load() > kPatience_ns) {
      std::signal(number, SIG_DFL);
      std::raise(number);
    }
  };
  std::signal(SIGINT, handler);
  std::signal(SIGTERM, handler);
  if (std::signal(SIGHUP, handler) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);  // nohup
}

}  // namespace equipoise::app
