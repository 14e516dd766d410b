// What surrounds a flight on the robot: the guard process, real time, deadlines. In: options -> out: a
// Supervisor for the loop, and afterwards what was obtained and how punctual the loop was. Order matters: the
// guard before the board is opened, real time in the loop's thread after all other threads have been made,
// which would inherit it.
#pragma once

#include <memory>
#include <string>

#include "app/cli/json.hpp"
#include "app/guard/guard_process.hpp"
#include "equipoise/runtime/realtime.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

struct WatchOptions {
  std::string board_path;
  bool guard = true;
  bool realtime = true;                   // false: fly without, loudly
  bool calibrated = true;                 // likewise
  int cpu = -1;                           // -1: wherever the kernel likes
  int priority = runtime::kLoopPriority;  // SCHED_FIFO
};

class FlightWatch {
 public:
  explicit FlightWatch(const WatchOptions& options);  // starts the guard; runtime_error when it fails

  /// `missing_calibration`: what the board's calibration lacks, see missing_calibration(); empty: nothing.
  void note(const std::string& missing_calibration);

  /// f(supervisor) under real time; says on stderr what is missing.
  template <class F>
  auto fly(const std::atomic<bool>& log_failed, F&& f) {
    const runtime::Realtime realtime(begin());
    note(realtime);
    runtime::Supervisor supervisor({guard_ ? &guard_->page() : nullptr, standing_, &log_failed, false});
    auto result = f(supervisor);
    note(supervisor.timing());
    return result;
  }

  /// guard, realtime, timing: for a summary.
  const nlohmann::json& summary() const noexcept { return summary_; }

 private:
  runtime::RealtimeWish begin() const;
  void note(const runtime::Realtime& realtime);
  void note(const runtime::LoopTiming& timing);

  WatchOptions options_;
  std::unique_ptr<GuardProcess> guard_;
  std::uint32_t standing_ = 0;
  nlohmann::json summary_;
};

/// Per item: wanted, obtained, errno.
nlohmann::json to_json(const runtime::Realtime& realtime);
/// p50_us, p99_us, max_us, count.
nlohmann::json to_json(const runtime::TimeHistogram& histogram);

}  // namespace equipoise::app
