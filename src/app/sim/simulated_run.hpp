// One run in the simulated world, tick by tick: world, hardware boundary, loop, firmware and meter. In:
// world, firmware, options -> out: summary. Simulation only.
#pragma once

#include <optional>

#include "app/io/plant_backend.hpp"
#include "app/sim/simulate.hpp"
#include "app/trial/root_mean_square.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

/// What a run's summary counts, tick by tick.
class RunMeter {
 public:
  RunMeter(const ConfiguredRobot& robot, const Firmware& firmware, const Script& script)
      : robot_(robot), firmware_(firmware), script_(script), compared_(robot.type->estimators.size()) {}

  void observe(const runtime::TickRecord& t, const StateView& truth, double time_s);
  SimSummary summary(const Verdict& verdict, std::int64_t ticks, double wall_s) const;

 private:
  struct Errors {
    RootMeanSquare attitude, speed;
    void add(const StateErrors& e) {
      attitude.add(e.attitude_squared, e.axes);
      speed.add(e.speed_squared, e.axes);
    }
    EstimatorErrors value() const { return {attitude.value(), speed.value()}; }
  };

  const ConfiguredRobot& robot_;
  const Firmware& firmware_;
  const Script& script_;
  Errors controlling_;
  std::vector<Errors> compared_;
  RootMeanSquare position_, following_, rolling_;
  Vec2 path_start_W_m_ = Vec2::Zero();
  double innovation_sum_ = 0.0;
  std::int64_t innovations_ = 0;
  double heading_error_ = kUncounted;
  double yaw_from_ = 0.0;
  double yaw_from_s_ = -1.0;
  double yaw_to_ = 0.0;
  double yaw_to_s_ = 0.0;
  double duty_max_ = 0.0;
  std::int64_t saturated_ = 0;
  std::int64_t driven_ = 0;
  std::uint32_t degraded_ = 0;
};

class SimulatedRun : NoCopy {
 public:
  /// World, firmware, observer and stop must outlive it.
  SimulatedRun(World& world, Firmware& firmware, const ConfiguredRobot& robot, const SimOptions& options,
               const TickObserver& observe, const std::atomic<bool>& stop);

  /// To the end: time, a fall, or `stop`.
  SimSummary run();

  /// One tick; false when the run has ended.
  bool step();

 private:
  rio_t broken_as(const std::vector<PlannedFault>& faults, std::uint64_t seed);
  auto commands();
  auto observer();
  void observe(std::int64_t tick, const runtime::TickRecord& t);

  World& world_;
  Firmware& firmware_;
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
};

}  // namespace equipoise::app
