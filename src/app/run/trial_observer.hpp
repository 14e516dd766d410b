// One trial of a real or external robot, as the loop's observer: every tick is judged, recorded and shown,
// and the last one recognised. In: pipeline, supervisor, telemetry, limits -> out: Trial. operator() is
// RT-safe.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "app/cli/interrupt.hpp"
#include "app/run/status_indicator.hpp"
#include "app/run/trial.hpp"
#include "app/trial/firmware.hpp"
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

template <class Pipeline>
class TrialObserver {
 public:
  /// `indicator` may be nullptr.
  TrialObserver(const Pipeline& pipeline, const runtime::Supervisor& supervisor,
                runtime::Telemetry& telemetry, StatusIndicator* indicator, const TrialLimits& limits)
      : pipeline_(pipeline),
        supervisor_(supervisor),
        telemetry_(telemetry),
        indicator_(indicator),
        last_tick_(limits.last_tick()),
        end_on_fall_(limits.end_on_fall) {}

  void operator()(std::int64_t tick, std::int64_t now_ns, const RawSample& raw, const Command& command,
                  const typename Pipeline::Result& t) noexcept {
    judge_.observe({static_cast<double>(tick) * kTickS, command.arm, t.arm_state == ArmState::kArmed,
                    t.reasons, std::numeric_limits<double>::quiet_NaN()});
    measure(t);
    record(tick, now_ns, raw, command, t);
    if (indicator_ != nullptr) indicator_->tell(t.arm_state, t.reasons, t.z.battery_V);
    const bool unrecorded = (t.inhibit & kLogFailed) != 0;  // the motors are off for it
    if (tick >= last_tick_ || (judge_.lost() && end_on_fall_) || unrecorded ||
        interrupted.load(std::memory_order_relaxed))
      done_ = true;
  }

  const std::atomic<bool>& done() const noexcept { return done_; }

  Trial trial(const runtime::LoopEnd& end) const {
    Trial out = trial_;
    out.ticks = end.ticks;
    out.error = end.error;
    out.armed = judge_.armed();
    out.verdict = judge_.verdict(interrupted.load(), end.error != 0 && end.error != -ESHUTDOWN);
    return out;
  }

 private:
  void measure(const typename Pipeline::Result& t) noexcept {
    if (!t.motors.enable) return;
    ++trial_.driven;
    trial_.saturated += t.saturated ? 1 : 0;
    for (const double duty : t.motors.duty) trial_.duty_max = std::max(trial_.duty_max, std::abs(duty));
  }

  void record(std::int64_t tick, std::int64_t now_ns, const RawSample& raw, const Command& command,
              const typename Pipeline::Result& t) noexcept {
    record_tick(tick, now_ns, raw, command, t, pipeline_, &record_);
    const runtime::TickTiming& timing = supervisor_.timing().now();
    record_.wake_late_ns = timing.wake_late_ns;
    record_.compute_ns = timing.compute_ns;
    record_.overruns = timing.overruns;
    record_.dropped_records = telemetry_.dropped();
    telemetry_.hand_over(record_);
  }

  const Pipeline& pipeline_;
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
