#include "app/run/realtime_session.hpp"

#include <cstdio>

namespace equipoise::app {

RealtimeSession::RealtimeSession(const SessionOptions& options, const std::string& missing_calibration)
    : options_(options) {
  if (options.guard) {
    guard_ = std::make_unique<GuardProcess>(options.board_path);
  } else {
    std::fprintf(
        stderr,
        "equipoise: warning: no guard: if this process dies or hangs, the motors keep their last duty\n");
  }
  summary_["guard"] = options.guard;
  summary_["calibrated"] = missing_calibration.empty();
  if (missing_calibration.empty()) return;
  if (options.calibrated) standing_ |= kNotCalibrated;
  std::fprintf(stderr, "equipoise: warning: %s: %s (equipoise calibrate finds it)\n",
               options.calibrated ? "the motors stay off without a calibration (or say --without-calibration)"
                                  : "running without a calibration",
               missing_calibration.c_str());
}

runtime::Supervisor& RealtimeSession::begin(const std::atomic<bool>& log_failed) {
  runtime::RealtimeWish wish;
  wish.cpu = options_.cpu;
  wish.priority = options_.priority;
  realtime_.emplace(wish);
  summary_["realtime"] = to_json(*realtime_);
  if (!realtime_->complete()) {
    if (options_.realtime) standing_ |= kRealtimeMissing;
    std::fprintf(stderr, "equipoise: warning: %s:\n%s\n",
                 options_.realtime ? "the motors stay off without real time (or say --without-realtime)"
                                   : "running without full real time",
                 realtime_->complaint().c_str());
  }
  supervisor_.emplace(runtime::Watched{guard_ ? &guard_->page() : nullptr, standing_, &log_failed, false});
  return *supervisor_;
}

void RealtimeSession::end() {
  const runtime::LoopTiming& timing = supervisor_->timing();
  summary_["wake_late"] = to_json(timing.wake());
  summary_["compute"] = to_json(timing.compute());
  summary_["overruns"] = timing.now().overruns;
  realtime_.reset();
}

nlohmann::json to_json(const runtime::Realtime& realtime) {
  nlohmann::json out{{"complete", realtime.complete()}};
  for (std::size_t i = 0; i < runtime::kRealtimeItems; ++i) {
    const runtime::RealtimeResult& r = realtime.results()[i];
    out[runtime::kRealtimeItemNames[i]] = {
        {"wanted", r.wanted}, {"obtained", r.obtained}, {"errno", r.error}};
  }
  return out;
}

nlohmann::json to_json(const runtime::TimeHistogram& histogram) {
  return {{"p50_us", 1e-3 * static_cast<double>(histogram.quantile_ns(0.5))},
          {"p99_us", 1e-3 * static_cast<double>(histogram.quantile_ns(0.99))},
          {"max_us", 1e-3 * static_cast<double>(histogram.max_ns())},
          {"count", histogram.total()}};
}

}  // namespace equipoise::app
