#include "app/sim/simulated_run.hpp"

#include <chrono>
#include <cmath>

namespace equipoise::app {

SimulatedRun::SimulatedRun(World& world, Firmware& firmware, const ConfiguredRobot& robot,
                           const SimOptions& options, const TickObserver& observe,
                           const std::atomic<bool>& stop)
    : world_(world),
      firmware_(firmware),
      robot_(*robot.type),
      options_(options),
      observe_(observe),
      stop_(stop),
      backend_(world),
      hardware_(broken_as(options.faults, options.seed)),
      meter_(robot_.estimators.size(), robot.rolling_radius_m),
      supervisor_({nullptr, 0, options.log_failed, true}),
      end_tick_(static_cast<std::int64_t>(std::llround(options.duration_s * kTickHz))) {
  if (!observe && !firmware.reads_attitude()) world.without_attitude();
}

rio_t SimulatedRun::broken_as(const std::vector<PlannedFault>& faults, std::uint64_t seed) {
  if (faults.empty()) return backend_.io();
  constexpr double kNoWaiting = std::numeric_limits<double>::infinity();
  return breaking_.emplace(backend_.io(), kNoWaiting, faults, seed).io();
}

auto SimulatedRun::commands() {
  return [this](std::int64_t, std::int64_t) {
    firmware_.observe_truth(world_);
    return options_.script.at(world_.time_s());
  };
}

auto SimulatedRun::observer() {
  return [this](std::int64_t tick, std::int64_t, const RawSample&, const Command&,
                const runtime::TickRecord& t) { observe(tick, t); };
}

SimSummary SimulatedRun::run() {
  const auto start = std::chrono::steady_clock::now();
  end_ = runtime::run_loop(hardware_, firmware_, commands(), observer(), done_, supervisor_);
  wall_s_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary();
}

bool SimulatedRun::step() {
  if (!done_) runtime::run_tick(hardware_, firmware_, commands(), observer(), supervisor_, &end_);
  return !done_;
}

SimSummary SimulatedRun::summary() const {
  SimSummary s = meter_.summary(judge_.verdict(stop_.load(), false), end_.ticks, wall_s_);
  s.degraded = degraded_;
  for (std::size_t i = 0; i < robot_.estimators.size(); ++i) {
    if (firmware_.runs(i)) s.estimators[robot_.estimators[i]] = meter_.compared_errors(i);
  }
  return s;
}

void SimulatedRun::observe(std::int64_t tick, const runtime::TickRecord& t) {
  const StateView truth = world_.truth();
  const double time_s = world_.time_s();
  if (options_.figures) measure(t, truth, time_s);
  judge_.observe({time_s, t.arm, t.arm_state == static_cast<std::int32_t>(ArmState::kArmed), t.reasons,
                  truth.theta_rad.head<2>().norm(), reason_numbers(t), t.faults});
  if (lost()) done_ = true;
  if (observe_) {
    runtime::TickRecord record = t;
    record.tick = tick;
    record.truth = runtime::to_record(truth);
    record.has_truth = true;
    observe_(record);
  }
  if (tick + 1 >= end_tick_ || stop_.load(std::memory_order_relaxed)) done_ = true;
}

void SimulatedRun::measure(const runtime::TickRecord& t, const StateView& truth, double time_s) {
  const StateView seen = runtime::to_view(t.estimate);
  meter_.motors(t.motors, t.saturated);
  meter_.heading(seen, truth);
  degraded_ |= t.degraded;
  if (options_.script.path != nullptr && time_s >= kDriveFrom_s)
    meter_.following(options_.script.path->at(time_s - kDriveFrom_s),
                     rotate(-robot_.forward_rad, truth.position_W_m));
  if (!RunMeter::settled(time_s)) return;
  const StateErrors e = firmware_.errors_of(seen, truth);
  meter_.controlling(e);
  meter_.rolling(seen, truth, e.axes);
  meter_.innovation(seen);
  for (std::size_t i = 0; i < robot_.estimators.size(); ++i) {
    if (firmware_.runs(i)) meter_.compared(i, firmware_.errors_of(runtime::to_view(t.others[i]), truth));
  }
  meter_.path(time_s, runtime::to_view(t.reference), truth);
}

SimSummary simulate(const ConfiguredRobot& robot, const Choice& choice, const SimOptions& options,
                    const TickObserver& observe, const std::atomic<bool>& stop) {
  const auto firmware = robot.firmware(choice);
  const auto world = robot.world(choice, options.seed);
  return SimulatedRun(*world, *firmware, robot, options, observe, stop).run();
}

}  // namespace equipoise::app
