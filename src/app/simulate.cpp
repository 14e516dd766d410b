#include "simulate.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "equipoise/plant/mbbr_world.hpp"
#include "equipoise/runtime/loop.hpp"
#include "firmware.hpp"
#include "plant_backend.hpp"

namespace equipoise::app {
namespace {

constexpr double kFallenTilt_rad = 0.6;

/// Root mean square over samples and axes.
class Rms {
 public:
  void add(double squared, int axes) {
    sum_ += squared;
    count_ += axes;
  }
  double value() const { return count_ > 0 ? std::sqrt(sum_ / static_cast<double>(count_)) : 0.0; }

 private:
  double sum_ = 0.0;
  std::int64_t count_ = 0;
};

class ErrorMeter {
 public:
  /// Attitude: roll and pitch. Ball speed: inertial velocity of the ball, [T] section 6.4.
  void add(const MbbrEstimate& x, const MbbrEstimate& truth, double r) {
    attitude_.add((x.theta_xy - truth.theta_xy).squaredNorm(), 2);
    const Vec2 v = rotate(x.theta_z, x.phi_dot_star) - rotate(truth.theta_z, truth.phi_dot_star);
    speed_.add(r * r * v.squaredNorm(), 2);
  }
  EstimatorErrors value() const { return {attitude_.value(), speed_.value()}; }

 private:
  Rms attitude_, speed_;
};

Command script(const SimOptions& o, double t) {
  Command c;
  c.arm = t >= kArmAt_s;
  if (t >= kDriveFrom_s) {
    c.velocity_W_m_s = Vec2(o.drive_mps, 0.0);
    c.yaw_rate_rad_s = 2.0 * kPi * o.yaw_hz;
  }
  return c;
}

template <class Pipeline>
SimSummary fly(const MbbrConfig& config, const WorldParams& world_params, Pipeline& pipeline,
               const SimOptions& options, const TickObserver& observe, const std::atomic<bool>& stop) {
  MbbrWorld world(config.robot, config.motor, config.calibration, world_params);
  PlantBackend<MbbrWorld> backend(world);
  Hardware hardware(backend.io());
  MbbrEstimators& estimators = pipeline.estimators();

  SimSummary summary;
  ErrorMeter controlling;
  std::array<ErrorMeter, MbbrEstimators::kCount> compared;
  Rms position;
  double yaw_from = 0.0;
  double yaw_from_s = -1.0;
  double yaw_to = 0.0;
  double yaw_to_s = 0.0;
  std::int64_t saturated = 0;
  std::int64_t driven = 0;
  std::atomic<bool> done{false};
  const auto end_tick = static_cast<std::int64_t>(std::llround(options.duration_s * kTickHz));
  runtime::TickRecord record{};
  const bool records = static_cast<bool>(observe);

  const auto commands = [&](std::int64_t, std::int64_t) {
    estimators.observe_truth(world.truth());
    return script(options, world.time_s());
  };
  const auto on_tick = [&](std::int64_t tick, std::int64_t now_ns, const RawSample& raw,
                           const Command& command, const typename Pipeline::Result& t) {
    const MbbrEstimate truth = world.truth();
    const double time_s = world.time_s();
    if (t.motors.enable) {
      ++driven;
      saturated += t.saturated ? 1 : 0;
      for (const double duty : t.motors.duty) summary.duty_max = std::max(summary.duty_max, std::abs(duty));
    }
    if (time_s >= kSettled_s) {
      controlling.add(t.x_hat, truth, config.robot.r);
      for (std::size_t i = 0; i < compared.size(); ++i) {
        const auto id = static_cast<MbbrEstimatorId>(i);
        if (estimators.runs(id)) compared[i].add(estimators.estimate(id), truth, config.robot.r);
      }
      position.add(config.robot.r * config.robot.r * (t.ref.phi - truth.phi).squaredNorm(), 1);
      if (yaw_from_s < 0.0) {
        yaw_from_s = time_s;
        yaw_from = truth.theta_z;
      }
      yaw_to_s = time_s;
      yaw_to = truth.theta_z;
    }
    const bool lost = time_s > kArmAt_s + 0.1 && t.arm_state != ArmState::kArmed;
    if (lost || truth.theta_xy.norm() > kFallenTilt_rad) {
      summary.fell = true;
      summary.fell_at_s = time_s;
      summary.reasons = t.reasons;
      done = true;
    }
    if (records) {
      record_tick(tick, now_ns, raw, command, t, pipeline, &record);
      record.truth = runtime::to_record(view(truth, config.robot));
      record.has_truth = true;
      observe(record);
    }
    if (tick + 1 >= end_tick || stop.load(std::memory_order_relaxed)) done = true;
  };

  const auto start = std::chrono::steady_clock::now();
  const runtime::LoopEnd end = runtime::run_loop(hardware, pipeline, commands, on_tick, done);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  summary.interrupted = stop.load();
  summary.ticks = end.ticks;
  summary.real_time_factor = static_cast<double>(end.ticks) * kTickS / wall_s;
  summary.controlling = controlling.value();
  summary.position_rmse_m = position.value();
  summary.saturated_fraction =
      driven > 0 ? static_cast<double>(saturated) / static_cast<double>(driven) : 0.0;
  if (yaw_to_s > yaw_from_s && yaw_from_s >= 0.0) {
    summary.yaw_rate_mean_hz = (yaw_to - yaw_from) / (2.0 * kPi * (yaw_to_s - yaw_from_s));
  }
  for (std::size_t i = 0; i < compared.size(); ++i) {
    if (estimators.runs(static_cast<MbbrEstimatorId>(i))) {
      summary.estimators[kMbbrEstimatorNames[i]] = compared[i].value();
    }
  }
  return summary;
}

}  // namespace

SimSummary simulate_mbbr(const MbbrConfig& configured, const SimOptions& options, const TickObserver& observe,
                         const std::atomic<bool>& stop) {
  const auto level = static_cast<std::size_t>(options.fidelity);
  Choice choice;
  choice.estimator = kMbbrEstimatorNames[static_cast<std::size_t>(configured.estimators.active)];
  choice.controller = kMbbrControllerNames[static_cast<std::size_t>(options.controller)];
  choice.fidelity = kFidelityNames[level];
  choice.compare = options.compare;
  const MbbrConfig config = MbbrFirmware::apply(configured, choice);
  WorldParams world = config.world[level];
  world.seed = options.seed;
  return MbbrFirmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    return fly(config, world, pipeline, options, observe, stop);
  });
}

}  // namespace equipoise::app
