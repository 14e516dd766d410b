#include "app/sim/simulated_run.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace equipoise::app {

void RunMeter::observe(const runtime::TickRecord& t, const StateView& truth, double time_s) {
  const StateView seen = runtime::to_view(t.estimate);
  if (t.motors.enable) {
    ++driven_;
    saturated_ += t.saturated ? 1 : 0;
    for (const double duty : t.motors.duty) duty_max_ = std::max(duty_max_, std::abs(duty));
  }
  heading_error_ = seen.theta_rad.z() - truth.theta_rad.z();
  degraded_ |= t.degraded;
  if (script_.path != nullptr && time_s >= kDriveFrom_s) {
    const Vec2 path_m = script_.path->at(time_s - kDriveFrom_s).position_W_m;
    const Vec2 forward_W_m = rotate(-robot_.type->forward_rad, truth.position_W_m);
    if (following_.count == 0.0) path_start_W_m_ = forward_W_m - path_m;
    following_.add((forward_W_m - path_start_W_m_ - path_m).squaredNorm());
  }
  if (time_s < kSettled_s) return;
  const StateErrors e = firmware_.errors_of(seen, truth);
  controlling_.add(e);
  rolling_.add((seen.phi_dot_rad_s - truth.phi_dot_rad_s).squaredNorm(), e.axes);
  innovation_sum_ += seen.normalized_innovation;
  ++innovations_;
  for (std::size_t i = 0; i < compared_.size(); ++i) {
    if (firmware_.runs(i)) compared_[i].add(firmware_.errors_of(runtime::to_view(t.others[i]), truth));
  }
  position_.add((runtime::to_view(t.reference).position_W_m - truth.position_W_m).squaredNorm());
  if (yaw_from_s_ < 0.0) {
    yaw_from_s_ = time_s;
    yaw_from_ = truth.theta_rad.z();
  }
  yaw_to_s_ = time_s;
  yaw_to_ = truth.theta_rad.z();
}

SimSummary RunMeter::summary(const Verdict& verdict, std::int64_t ticks, double wall_s) const {
  SimSummary s;
  s.verdict = verdict;
  s.controlling = controlling_.value();
  s.position_rmse_m = position_.value();
  s.path_rmse_m = following_.value();
  s.yaw_frame_speed_rmse_m_s = robot_.rolling_radius_m * rolling_.value();
  s.heading_error_rad = heading_error_;
  if (innovations_ > 0) s.normalized_innovation_mean = innovation_sum_ / static_cast<double>(innovations_);
  s.duty_max = duty_max_;
  s.saturated_fraction = driven_ > 0 ? static_cast<double>(saturated_) / static_cast<double>(driven_) : 0.0;
  if (yaw_to_s_ > yaw_from_s_ && yaw_from_s_ >= 0.0) {
    s.yaw_rate_mean_hz = (yaw_to_ - yaw_from_) / (2.0 * kPi * (yaw_to_s_ - yaw_from_s_));
  }
  s.degraded = degraded_;
  s.ticks = ticks;
  s.real_time_factor = static_cast<double>(ticks) * kTickS / wall_s;
  for (std::size_t i = 0; i < compared_.size(); ++i) {
    if (firmware_.runs(i)) s.estimators[robot_.type->estimators[i]] = compared_[i].value();
  }
  return s;
}

SimulatedRun::SimulatedRun(World& world, Firmware& firmware, const ConfiguredRobot& robot,
                           const SimOptions& options, const TickObserver& observe,
                           const std::atomic<bool>& stop)
    : world_(world),
      firmware_(firmware),
      options_(options),
      observe_(observe),
      stop_(stop),
      backend_(world),
      hardware_(broken_as(options.faults, options.seed)),
      meter_(robot, firmware, options_.script),
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
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return meter_.summary(judge_.verdict(stop_.load(), false), end_.ticks, wall_s);
}

bool SimulatedRun::step() {
  if (!done_) runtime::run_tick(hardware_, firmware_, commands(), observer(), supervisor_, &end_);
  return !done_;
}

void SimulatedRun::observe(std::int64_t tick, const runtime::TickRecord& t) {
  const StateView truth = world_.truth();
  const double time_s = world_.time_s();
  if (options_.figures) meter_.observe(t, truth, time_s);
  judge_.observe({time_s, t.arm, t.arm_state == static_cast<std::int32_t>(ArmState::kArmed), t.reasons,
                  truth.theta_rad.head<2>().norm(), reason_numbers(t), t.faults});
  if (judge_.lost() || judge_.refused()) done_ = true;
  if (observe_) {
    runtime::TickRecord record = t;
    record.tick = tick;
    record.truth = runtime::to_record(truth);
    record.has_truth = true;
    observe_(record);
  }
  if (tick + 1 >= end_tick_ || stop_.load(std::memory_order_relaxed)) done_ = true;
}

SimSummary simulate(const ConfiguredRobot& robot, const Choice& choice, const SimOptions& options,
                    const TickObserver& observe, const std::atomic<bool>& stop) {
  const auto firmware = robot.firmware(choice);
  const auto world = robot.world(choice, options.seed);
  return SimulatedRun(*world, *firmware, robot, options, observe, stop).run();
}

}  // namespace equipoise::app
