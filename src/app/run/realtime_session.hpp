// What surrounds a run on the robot: the guard process, real time, deadlines, standing reasons against the
// motors. In: options -> out: a Supervisor for the loop, and afterwards what was obtained and how punctual
// the loop was. Order matters: the guard before the board is opened, begin() in the loop's thread after all
// other threads have been made, which would inherit it.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "app/guard/guard_process.hpp"
#include "app/text/json.hpp"
#include "equipoise/runtime/realtime.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

struct SessionOptions {
  std::string board_path;
  bool guard = true;
  bool realtime = true;                   // false: run without, loudly
  bool calibrated = true;                 // likewise
  int cpu = -1;                           // -1: wherever the kernel likes
  int priority = runtime::kLoopPriority;  // SCHED_FIFO
};

class RealtimeSession {
 public:
  /// Starts the guard; runtime_error when it fails. `missing_calibration`: see missing_calibration(); empty:
  /// nothing.
  RealtimeSession(const SessionOptions& options, const std::string& missing_calibration);

  /// From here on this thread is the loop's; says on stderr what is missing.
  runtime::Supervisor& begin(const std::atomic<bool>& log_failed);
  void end();

  /// guard, calibrated, realtime, timing: for a summary.
  const nlohmann::json& summary() const noexcept { return summary_; }

 private:
  SessionOptions options_;
  std::unique_ptr<GuardProcess> guard_;
  std::optional<runtime::Realtime> realtime_;
  std::optional<runtime::Supervisor> supervisor_;
  std::uint32_t standing_ = 0;
  nlohmann::json summary_;
};

/// Per item: wanted, obtained, errno.
nlohmann::json to_json(const runtime::Realtime& realtime);
/// p50_us, p99_us, max_us, count.
nlohmann::json to_json(const runtime::TimeHistogram& histogram);

}  // namespace equipoise::app
