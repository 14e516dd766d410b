#include "app/run/trial_observer.hpp"

#include <algorithm>
#include <cerrno>
#include <limits>

#include "app/cli/interrupt.hpp"

namespace equipoise::app {

void TrialObserver::operator()(std::int64_t tick, const runtime::TickRecord& t) noexcept {
  const auto arm_state = static_cast<ArmState>(t.arm_state);
  judge_.observe({static_cast<double>(tick) * kTickS, t.arm, arm_state == ArmState::kArmed, t.reasons,
                  std::numeric_limits<double>::quiet_NaN(), reason_numbers(t)});
  measure(t);
  record(tick, t);
  if (indicator_ != nullptr) indicator_->tell(arm_state, t.reasons, t.battery_V);
  const bool unrecorded = (t.inhibit & kLogFailed) != 0;  // the motors are off for it
  if (tick >= last_tick_ || (judge_.lost() && end_on_fall_) || unrecorded ||
      interrupted.load(std::memory_order_relaxed))
    done_ = true;
}

Trial TrialObserver::trial(const runtime::LoopEnd& end) const {
  Trial out = trial_;
  out.ticks = end.ticks;
  out.error = end.error;
  out.armed = judge_.armed();
  out.verdict = judge_.verdict(interrupted.load(), end.error != 0 && end.error != -ESHUTDOWN);
  return out;
}

void TrialObserver::measure(const runtime::TickRecord& t) noexcept {
  if (!t.motors.enable) return;
  ++trial_.driven;
  trial_.saturated += t.saturated ? 1 : 0;
  for (const double duty : t.motors.duty) trial_.duty_max = std::max(trial_.duty_max, std::abs(duty));
}

void TrialObserver::record(std::int64_t tick, const runtime::TickRecord& t) noexcept {
  record_ = t;
  record_.tick = tick;
  const runtime::TickTiming& timing = supervisor_.timing().now();
  record_.wake_late_ns = timing.wake_late_ns;
  record_.compute_ns = timing.compute_ns;
  record_.overruns = timing.overruns;
  record_.dropped_records = telemetry_.dropped();
  telemetry_.hand_over(record_);
}

}  // namespace equipoise::app
