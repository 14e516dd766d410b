// One simulated run of a robot through the production pipeline and the hardware boundary.
// In: configuration, choices, options -> out: summary; every tick is handed to `observe`. Same seed, same
// numbers.
#pragma once

#include <atomic>
#include <functional>

#include "app/sim/run_meter.hpp"
#include "app/trial/firmware.hpp"
#include "app/trial/script.hpp"

namespace equipoise::app {

struct SimOptions {
  Script script;
  double duration_s = 30.0;
  std::uint64_t seed = 1;
  bool figures = true;                            // false: only the verdict
  const std::atomic<bool>* log_failed = nullptr;  // then the motors stop: nothing runs unrecorded
};

using TickObserver = std::function<void(const runtime::TickRecord&)>;

/// `choice.fidelity` names the world, `choice.controller` the pipeline.
SimSummary simulate(const ConfiguredRobot& robot, const Choice& choice, const SimOptions& options,
                    const TickObserver& observe, const std::atomic<bool>& stop);

}  // namespace equipoise::app
