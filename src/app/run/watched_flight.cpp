#include "app/run/watched_flight.hpp"

#include <cstdio>

namespace equipoise::app {

FlightWatch::FlightWatch(const WatchOptions& options) : options_(options) {
  if (options.guard) {
    guard_ = std::make_unique<GuardProcess>(options.board_path);
  } else {
    std::fprintf(
        stderr,
        "equipoise: warning: no guard: if this process dies or hangs, the motors keep their last duty\n");
  }
  summary_["guard"] = options.guard;
}

runtime::RealtimeWish FlightWatch::begin() const {
  runtime::RealtimeWish wish;
  wish.cpu = options_.cpu;
  wish.priority = options_.priority;
  return wish;
}

void FlightWatch::note(const runtime::Realtime& realtime) {
  summary_["realtime"] = to_json(realtime);
  if (realtime.complete()) return;
  if (options_.realtime) standing_ |= kRealtimeMissing;
  std::fprintf(stderr, "equipoise: warning: %s:\n%s\n",
               options_.realtime ? "the motors stay off without real time (or say --without-realtime)"
                                 : "flying without full real time",
               realtime.complaint().c_str());
}

void FlightWatch::note(const std::string& missing_calibration) {
  summary_["calibrated"] = missing_calibration.empty();
  if (missing_calibration.empty()) return;
  if (options_.calibrated) standing_ |= kNotCalibrated;
  std::fprintf(stderr, "equipoise: warning: %s: %s (equipoise calibrate finds it)\n",
               options_.calibrated
                   ? "the motors stay off without a calibration (or say --without-calibration)"
                   : "running without a calibration",
               missing_calibration.c_str());
}

void FlightWatch::note(const runtime::LoopTiming& timing) {
  summary_["wake_late"] = to_json(timing.wake());
  summary_["compute"] = to_json(timing.compute());
  summary_["overruns"] = timing.now().overruns;
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
