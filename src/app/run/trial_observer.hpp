// One trial of a real or external robot, as the loop's observer: every tick is judged, recorded and shown,
// and the last one recognised. In: supervisor, telemetry, limits -> out: Trial. operator() is
// RT-safe.
#pragma once

#include <atomic>
#include <cmath>

#include "app/run/status_indicator.hpp"
#include "app/run/trial.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {

struct TrialLimits {
  double duration_s = 0.0;  // 0: until the backend or a signal ends it
  bool end_on_fall = true;

  std::int64_t last_tick() const {
    return duration_s > 0.0 ? std::llround(duration_s * kTickHz) - 1 : INT64_MAX;
  }
};

class TrialObserver {
 public:
  /// `indicator` may be nullptr.
  TrialObserver(const runtime::Supervisor& supervisor, runtime::Telemetry& telemetry,
                StatusIndicator* indicator, const TrialLimits& limits)
      : supervisor_(supervisor),
        telemetry_(telemetry),
        indicator_(indicator),
        last_tick_(limits.last_tick()),
        end_on_fall_(limits.end_on_fall) {}

  void operator()(std::int64_t tick, const runtime::TickRecord& t) noexcept;

  const std::atomic<bool>& done() const noexcept { return done_; }

  Trial trial(const runtime::LoopEnd& end) const;

 private:
  void measure(const runtime::TickRecord& t) noexcept;
  void record(std::int64_t tick, const runtime::TickRecord& t) noexcept;

  const runtime::Supervisor& supervisor_;
  runtime::Telemetry& telemetry_;
  StatusIndicator* indicator_;
  std::int64_t last_tick_;
  bool end_on_fall_;
  VerdictJudge judge_;
  Trial trial_;
  runtime::TickRecord record_{};
  std::atomic<bool> done_{false};
};

}  // namespace equipoise::app
