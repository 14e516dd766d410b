// Takes one record per tick from the real-time thread and, on a thread of its own, writes it to an LCM event
// log and publishes it. In: TickRecord, lock-free -> out: log file, LCM messages (package equipoise).
// hand_over() is RT-safe; everything else is not. SIGKILL costs the log less than 100 ms. A telemetry URL
// that cannot be opened is a warning, never a reason not to run; a log that cannot be written is reported by
// finish() and by log_failed().
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/record.hpp"
#include "equipoise/runtime/spsc_queue.hpp"

namespace equipoise::runtime {

/// Stays on this host: time to live 0.
inline constexpr const char* kDefaultTelemetryUrl = "udpm://239.255.76.67:7667?ttl=0";

struct TelemetryOptions {
  std::string log_path;                 // empty: no log
  std::string url;                      // LCM provider; empty: nothing is published
  std::int64_t max_log_bytes = 0;       // then the log goes on in NAME.0001.lcm, ...; 0: one file
  std::int64_t min_free_bytes = 0;      // below it the run's oldest files are deleted, then the log stops
  bool sync = false;                    // to the disk itself, for a power cut; else to the kernel
  bool keep_previous = false;           // a log of the same name is moved aside rather than replaced
  double max_publish_hz = 20.0;         // of wall-clock time, for eyes; the log always has every tick
  bool wait_when_full = false;          // simulation faster than real time: wait rather than drop
  std::vector<std::string> estimators;  // names of TickRecord::others
  std::function<void(const TickRecord&)> watch;  // called by the thread, record by record
  RunInfo run;
};

struct TelemetryReport {
  std::int64_t records = 0;
  std::int64_t dropped = 0;
  std::string warning;    // telemetry could not be opened
  std::string log_error;  // the log ends early, and why; what is in it is whole
};

class Telemetry : NoCopy {
 public:
  /// Throws std::runtime_error if the log cannot be created.
  explicit Telemetry(const TelemetryOptions& options);
  ~Telemetry();

  void hand_over(const TickRecord& record) noexcept;
  /// For the loop's supervisor.
  const std::atomic<bool>& log_failed() const noexcept { return log_failed_; }
  std::int64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

  /// Drains, writes how the run ended, closes and joins; further records are ignored.
  TelemetryReport finish(const EndRecord& end);

 private:
  class Writer;
  void run();
  TelemetryReport join();

  TelemetryOptions options_;
  SpscQueue<TickRecord> queue_;
  TelemetryReport report_;
  std::optional<EndRecord> end_;  // before stop_ for the thread; none: the owner was left by an exception
  std::atomic<bool> stop_{false};
  std::atomic<bool> log_failed_{false};
  std::atomic<std::int64_t> dropped_{0};
  std::unique_ptr<Writer> writer_;
  std::thread thread_;
};

}  // namespace equipoise::runtime
