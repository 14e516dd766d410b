// One flight of a real or external robot: from a backend that is open to the end of its ticks.
// In: backend, pipeline, source of commands, telemetry -> out: what happened. Motors are off at the end.
// The loop's body is RT-safe as far as the backend is.
#pragma once

#include <algorithm>
#include <cmath>

#include "app/cli/interrupt.hpp"
#include "app/io/hardware.hpp"
#include "app/run/announcer.hpp"
#include "app/run/firmware.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

struct Flight {
  std::int64_t ticks = 0;
  int error = 0;       // -errno that ended the ticks; -ESHUTDOWN: the backend had no more
  bool armed = false;  // at least once
  bool fell = false;   // motors went off while they were asked for
  double fell_at_s = 0.0;
  std::uint32_t reasons = 0;  // why the motors are off: at the fall, else at the end
  double duty_max = 0.0;
  std::int64_t driven = 0;
  std::int64_t saturated = 0;

  double duration_s() const { return static_cast<double>(ticks) * kTickS; }
};

struct FlightLimits {
  double duration_s = 0.0;  // 0: until the backend or a signal ends it
  bool end_on_fall = true;
};

/// `announcer` may be nullptr.
template <class Pipeline, class Commands>
Flight fly(rio_t io, Pipeline& pipeline, Commands&& commands, const FlightLimits& limits,
           runtime::Supervisor& supervisor, runtime::Telemetry& telemetry, Announcer* announcer) {
  Hardware hardware(io);
  Flight flight;
  runtime::TickRecord record{};
  std::atomic<bool> done{false};
  const std::int64_t last_tick =
      limits.duration_s > 0.0 ? std::llround(limits.duration_s * kTickHz) - 1 : INT64_MAX;
  const auto on_tick = [&](std::int64_t tick, std::int64_t now_ns, const RawSample& raw,
                           const Command& command, const typename Pipeline::Result& t) {
    if (t.motors.enable) {
      flight.armed = true;
      ++flight.driven;
      flight.saturated += t.saturated ? 1 : 0;
      for (const double duty : t.motors.duty) flight.duty_max = std::max(flight.duty_max, std::abs(duty));
    }
    if (!flight.fell) flight.reasons = t.reasons;
    if (flight.armed && !flight.fell && command.arm && !t.motors.enable) {
      flight.fell = true;
      flight.fell_at_s = static_cast<double>(tick) * kTickS;
    }
    record_tick(tick, now_ns, raw, command, t, pipeline, &record);
    const runtime::TickTiming& timing = supervisor.timing().now();
    record.wake_late_ns = timing.wake_late_ns;
    record.compute_ns = timing.compute_ns;
    record.overruns = timing.overruns;
    record.dropped_records = telemetry.dropped();
    telemetry.hand_over(record);
    if (announcer != nullptr) announcer->tell(t.arm_state, t.reasons, t.z.battery_V);
    const bool unrecorded = (t.inhibit & kLogFailed) != 0;  // the motors are off for it
    if (tick >= last_tick || (flight.fell && limits.end_on_fall) || unrecorded) done = true;
    if (interrupted.load(std::memory_order_relaxed)) done = true;
  };
  const runtime::LoopEnd end = runtime::run_loop(hardware, pipeline, commands, on_tick, done, supervisor);
  flight.ticks = end.ticks;
  flight.error = end.error;
  return flight;
}

}  // namespace equipoise::app
