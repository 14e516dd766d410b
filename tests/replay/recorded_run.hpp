// A simulated run that is logged as a flight is: nominal world, default estimator and controller. In: path of
// the log, plan, seed, what sees each tick's record and hands it over -> out: the log.
#pragma once

#include <string>

#include "app/evaluate/fault_run.hpp"
#include "app/log/replay_as.hpp"
#include "equipoise/runtime/telemetry.hpp"
#include "support/trial.hpp"

namespace equipoise {

/// keep(telemetry, record, command, result of the tick)
template <class Firmware, class Keep>
void record_run(const std::string& path, const app::FaultPlan& plan, std::uint64_t seed, Keep&& keep) {
  app::Choice choice;
  choice.fidelity = "nominal";
  app::complete<Firmware>(choice);
  const auto loaded = Firmware::load(config_file<Firmware>(), {});
  const auto config = Firmware::apply(loaded.config, choice);
  runtime::TelemetryOptions options;
  options.log_path = path;
  options.wait_when_full = true;
  options.run = app::run_info<Firmware>(loaded, choice, static_cast<std::int64_t>(seed));
  options.run.backend = "sim";
  runtime::Telemetry telemetry(options);
  auto world = Firmware::world(config, app::fidelity_level(choice.fidelity), seed);
  Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    runtime::TickRecord r{};
    const auto each = [&](std::int64_t tick, std::int64_t now_ns, const RawSample& raw,
                          const Command& command, const auto& t) {
      app::record_tick(tick, now_ns, raw, command, t, pipeline, &r);
      keep(telemetry, r, command, t);
    };
    (void)app::run_with_fault(world, pipeline, plan, seed, each);
  });
}

}  // namespace equipoise
