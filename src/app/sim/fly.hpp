// The body of simulate(): world, hardware boundary, loop, pipeline and meter of one run.
// In: world, pipeline, options -> out: summary. Included by simulate_*.cpp only.
#pragma once

#include <chrono>

#include "app/io/plant_backend.hpp"
#include "app/sim/simulate.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

/// What the pilot asks for at time t.
inline Command script(const SimOptions& o, double t) {
  Command c;
  c.arm = t >= kArmAt_s;
  if (t >= kDriveFrom_s) {
    c.velocity_W_m_s = Vec2(o.drive_mps, 0.0);
    c.yaw_rate_rad_s = o.yaw_rate_rad_s;
  }
  return c;
}

template <class World, class Pipeline>
SimSummary fly(World& world, Pipeline& pipeline, double rolling_radius_m, const SimOptions& options,
               const TickObserver& observe, const std::atomic<bool>& stop) {
  PlantBackend<World> backend(world);
  Hardware hardware(backend.io());
  auto& estimators = pipeline.estimators();
  using Estimators = std::decay_t<decltype(estimators)>;
  const auto& robot = pipeline.params().robot;

  RunMeter meter(Estimators::kCount, rolling_radius_m);
  VerdictJudge judge;
  std::atomic<bool> done{false};
  const auto end_tick = static_cast<std::int64_t>(std::llround(options.duration_s * kTickHz));
  runtime::TickRecord record{};
  std::uint32_t degraded = 0;
  const bool records = static_cast<bool>(observe);

  const auto commands = [&](std::int64_t, std::int64_t) {
    estimators.observe_truth(world.truth());
    return script(options, world.time_s());
  };
  const auto on_tick = [&](std::int64_t tick, std::int64_t now_ns, const RawSample& raw,
                           const Command& command, const typename Pipeline::Result& t) {
    const auto truth = world.truth();
    const StateView truth_view = view(truth, robot);
    const double time_s = world.time_s();
    const StateView seen = view(t.x_hat, robot);
    meter.motors(t.motors, t.saturated);
    meter.heading(seen, truth_view);
    degraded |= t.degraded;
    if (RunMeter::settled(time_s)) {
      const StateErrors e = errors(t.x_hat, truth, robot);
      meter.controlling(e);
      meter.rolling(seen, truth_view, e.axes);
      for (std::size_t i = 0; i < Estimators::kCount; ++i) {
        const auto id = static_cast<typename Estimators::Id>(i);
        if (estimators.runs(id)) meter.compared(i, errors(estimators.estimate(id), truth, robot));
      }
      meter.path(time_s, view(t.ref, robot), truth_view);
    }
    judge.observe({time_s, command.arm, t.motors.enable, t.reasons, truth_view.theta_rad.head<2>().norm()});
    if (judge.lost() || judge.refused()) done = true;
    if (records) {
      record_tick(tick, now_ns, raw, command, t, pipeline, &record);
      record.truth = runtime::to_record(truth_view);
      record.has_truth = true;
      observe(record);
    }
    if (tick + 1 >= end_tick || stop.load(std::memory_order_relaxed)) done = true;
  };

  const auto start = std::chrono::steady_clock::now();
  runtime::Supervisor supervisor({nullptr, 0, options.log_failed, true});
  const runtime::LoopEnd end = runtime::run_loop(hardware, pipeline, commands, on_tick, done, supervisor);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  SimSummary summary = meter.summary(judge.verdict(stop.load(), false), end.ticks, wall_s);
  summary.degraded = degraded;
  for (std::size_t i = 0; i < Estimators::kCount; ++i) {
    if (estimators.runs(static_cast<typename Estimators::Id>(i))) {
      summary.estimators[Estimators::kNames[i]] = meter.compared_errors(i);
    }
  }
  return summary;
}

template <class Firmware>
SimSummary simulate(const typename Firmware::Config& configured, const Choice& choice,
                    const SimOptions& options, const TickObserver& observe, const std::atomic<bool>& stop) {
  const typename Firmware::Config config = Firmware::apply(configured, choice);
  typename Firmware::World world = Firmware::world(config, fidelity_level(choice.fidelity), options.seed);
  return Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    return fly(world, pipeline, Firmware::rolling_radius_m(config), options, observe, stop);
  });
}

}  // namespace equipoise::app
