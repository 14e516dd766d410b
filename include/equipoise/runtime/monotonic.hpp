// CLOCK_MONOTONIC as numbers, the loop clock of hardware. RT-safe: a vDSO call; a sleep.
#pragma once

#include <time.h>

#include <cstdint>

namespace equipoise::runtime {

inline std::int64_t monotonic_now_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

/// For waits and silences; not for ticks. Goes on while the machine is suspended, as monotonic_now_ns() does
/// not.
inline double now_s() noexcept {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Returns early when a signal comes.
inline void sleep_until(std::int64_t at_ns) noexcept {
  timespec at{};
  at.tv_sec = static_cast<time_t>(at_ns / 1'000'000'000);
  at.tv_nsec = static_cast<long>(at_ns % 1'000'000'000);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

}  // namespace equipoise::runtime
