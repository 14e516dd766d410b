// One run in the simulated world, tick by tick: world, hardware boundary, loop, firmware and meter. In:
// world, firmware, options -> out: summary. Simulation only.
#pragma once

#include <optional>

#include "app/io/plant_backend.hpp"
#include "app/sim/simulate.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

class SimulatedRun : NoCopy {
 public:
  /// World, firmware, observer and stop must outlive it.
  SimulatedRun(World& world, Firmware& firmware, const ConfiguredRobot& robot, const SimOptions& options,
               const TickObserver& observe, const std::atomic<bool>& stop);

  /// To the end: time, a fall, or `stop`.
  SimSummary run();

  /// One tick; false when the run has ended.
  bool step();

  /// What is asked for from the next tick on.
  Script& script() noexcept { return options_.script; }
  bool lost() const noexcept { return judge_.lost() || judge_.refused(); }

  SimSummary summary() const;

 private:
  rio_t broken_as(const std::vector<PlannedFault>& faults, std::uint64_t seed);
  auto commands();
  auto observer();
  void observe(std::int64_t tick, const runtime::TickRecord& t);
  void measure(const runtime::TickRecord& t, const StateView& truth, double time_s);

  World& world_;
  Firmware& firmware_;
  const RobotType& robot_;
  SimOptions options_;
  const TickObserver& observe_;
  const std::atomic<bool>& stop_;
  PlantBackend backend_;
  std::optional<PracticeBackend> breaking_;  // where something is to break
  Hardware hardware_;
  RunMeter meter_;
  VerdictJudge judge_;
  runtime::Supervisor supervisor_;
  std::int64_t end_tick_;
  std::atomic<bool> done_{false};
  runtime::LoopEnd end_;
  std::uint32_t degraded_ = 0;
  double wall_s_ = 0.0;
};

}  // namespace equipoise::app
