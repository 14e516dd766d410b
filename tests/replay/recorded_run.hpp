// A simulated run that is logged as one on a robot is: nominal world, default estimator and controller. In:
// robot, path of the log, plan, seed, what sees each tick's record and hands it over -> out: the log.
#pragma once

#include <string>

#include "app/evaluate/fault_run.hpp"
#include "app/log/replay.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise {

/// keep(telemetry, record of the tick)
template <class Keep>
void record_run(const app::ConfiguredRobot& robot, const std::string& path, const app::FaultPlan& plan,
                std::uint64_t seed, Keep&& keep) {
  app::Choice choice;
  choice.fidelity = "nominal";
  app::complete(*robot.type, &choice);
  runtime::TelemetryOptions options;
  options.log_path = path;
  options.wait_when_full = true;
  options.run = app::run_info(robot, choice, static_cast<std::int64_t>(seed));
  options.run.backend = "sim";
  runtime::Telemetry telemetry(options);
  (void)app::run_with_fault(robot, choice, plan, seed,
                            [&](const runtime::TickRecord& r) { keep(telemetry, r); });
}

}  // namespace equipoise
