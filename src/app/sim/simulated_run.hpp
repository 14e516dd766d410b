// One run in the simulated world, tick by tick: world, hardware boundary, loop, pipeline and meter. In:
// world, pipeline, options -> out: summary. The body of simulate(). Included by simulate_*.cpp and by what
// steps a robot from outside (src/python), which reads no figures and pays for none, only.
#pragma once

#include <chrono>

#include "app/io/plant_backend.hpp"
#include "app/sim/simulate.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

enum class Figures { kWanted, kNone };

template <class Firmware, class World, class Pipeline, Figures kFigures = Figures::kWanted>
class SimulatedRun {
 public:
  /// World, pipeline, observer and stop must outlive it.
  SimulatedRun(World& world, Pipeline& pipeline, double rolling_radius_m, const SimOptions& options,
               const TickObserver& observe, const std::atomic<bool>& stop)
      : world_(world),
        pipeline_(pipeline),
        options_(options),
        observe_(observe),
        stop_(stop),
        backend_(world),
        hardware_(backend_.io()),
        meter_(Estimators::kCount, rolling_radius_m),
        supervisor_({nullptr, 0, options.log_failed, true}),
        end_tick_(static_cast<std::int64_t>(std::llround(options.duration_s * kTickHz))) {
    if (!observe && !pipeline.estimators().reads_attitude()) world.without_attitude();
  }
  SimulatedRun(const SimulatedRun&) = delete;
  SimulatedRun& operator=(const SimulatedRun&) = delete;

  /// To the end: time, a fall, or `stop`.
  SimSummary run() {
    const auto start = std::chrono::steady_clock::now();
    end_ = runtime::run_loop(hardware_, pipeline_, commands(), observer(), done_, supervisor_);
    wall_s_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return summary();
  }

  /// One tick; false when the run has ended.
  bool step() {
    if (!done_) runtime::run_tick(hardware_, pipeline_, commands(), observer(), supervisor_, &end_);
    return !done_;
  }

  /// What is asked for from the next tick on.
  Script& script() noexcept { return options_.script; }
  /// What the world is advanced under in the next step; none will be: it has ended.
  const MotorCommand* next_command() const noexcept { return done_ ? nullptr : &backend_.command(); }
  bool lost() const noexcept { return judge_.lost() || judge_.refused(); }

  SimSummary summary() const {
    SimSummary s = meter_.summary(judge_.verdict(stop_.load(), false), end_.ticks, wall_s_);
    s.degraded = degraded_;
    for (std::size_t i = 0; i < Estimators::kCount; ++i) {
      if (pipeline_.estimators().runs(static_cast<typename Estimators::Id>(i))) {
        s.estimators[Estimators::kNames[i]] = meter_.compared_errors(i);
      }
    }
    return s;
  }

 private:
  using Result = typename Pipeline::Result;
  using Estimators = std::decay_t<decltype(std::declval<Pipeline&>().estimators())>;

  auto commands() {
    return [this](std::int64_t, std::int64_t) {
      if (pipeline_.estimators().runs(Estimators::Id::kTruth))
        pipeline_.estimators().observe_truth(world_.truth());
      return options_.script.at(world_.time_s());
    };
  }
  auto observer() {
    return [this](std::int64_t tick, std::int64_t now_ns, const RawSample& raw, const Command& command,
                  const Result& t) { observe(tick, now_ns, raw, command, t); };
  }

  void observe([[maybe_unused]] std::int64_t tick, [[maybe_unused]] std::int64_t now_ns,
               [[maybe_unused]] const RawSample& raw, const Command& command, const Result& t) {
    const auto& robot = pipeline_.params().robot;
    const auto truth = world_.truth();
    const StateView truth_view = view(truth, robot);
    const double time_s = world_.time_s();
    if constexpr (kFigures == Figures::kWanted) measure(t, truth, truth_view, time_s);
    judge_.observe({time_s, command.arm, t.arm_state == ArmState::kArmed, t.reasons,
                    truth_view.theta_rad.template head<2>().norm()});
    if (lost()) done_ = true;
    if (observe_) {
      record_tick(tick, now_ns, raw, command, t, pipeline_, &record_);
      record_.truth = runtime::to_record(truth_view);
      record_.has_truth = true;
      observe_(record_);
    }
    if (tick + 1 >= end_tick_ || stop_.load(std::memory_order_relaxed)) done_ = true;
  }

  template <class Truth>
  void measure(const Result& t, const Truth& truth, const StateView& truth_view, double time_s) {
    const auto& robot = pipeline_.params().robot;
    const auto& estimators = pipeline_.estimators();
    const StateView seen = view(t.x_hat, robot);
    meter_.motors(t.motors, t.saturated);
    meter_.heading(seen, truth_view);
    degraded_ |= t.degraded;
    if (options_.script.path != nullptr && time_s >= kDriveFrom_s)
      meter_.following(options_.script.path->at(time_s - kDriveFrom_s),
                       rotate(-Firmware::kForward_rad, truth_view.position_W_m));
    if (!RunMeter::settled(time_s)) return;
    const StateErrors e = errors(t.x_hat, truth, robot);
    meter_.controlling(e);
    meter_.rolling(seen, truth_view, e.axes);
    meter_.innovation(seen);
    for (std::size_t i = 0; i < Estimators::kCount; ++i) {
      const auto id = static_cast<typename Estimators::Id>(i);
      if (estimators.runs(id)) meter_.compared(i, errors(estimators.estimate(id), truth, robot));
    }
    meter_.path(time_s, view(t.ref, robot), truth_view);
  }

  World& world_;
  Pipeline& pipeline_;
  SimOptions options_;
  const TickObserver& observe_;
  const std::atomic<bool>& stop_;
  PlantBackend<World> backend_;
  Hardware hardware_;
  RunMeter meter_;
  VerdictJudge judge_;
  runtime::Supervisor supervisor_;
  std::int64_t end_tick_;
  std::atomic<bool> done_{false};
  runtime::TickRecord record_{};
  runtime::LoopEnd end_;
  std::uint32_t degraded_ = 0;
  double wall_s_ = 0.0;
};

template <class Firmware>
SimSummary simulate(const typename Firmware::Config& configured, const Choice& choice,
                    const SimOptions& options, const TickObserver& observe, const std::atomic<bool>& stop) {
  const typename Firmware::Config config = Firmware::apply(configured, choice);
  typename Firmware::World world = Firmware::world(config, fidelity_level(choice.fidelity), options.seed);
  return Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    using Pipeline = std::decay_t<decltype(pipeline)>;
    return SimulatedRun<Firmware, typename Firmware::World, Pipeline>(
               world, pipeline, Firmware::rolling_radius_m(config), options, observe, stop)
        .run();
  });
}

}  // namespace equipoise::app
