// One run with one injected fault through the production loop and supervisor, and whether it was safe. In:
// world, pipeline, phase, fault, seed -> out: what the motors did. Unsafe: duty after the fault's deadline,
// duty on a robot that lies, an estimate that is wrong while motors run, motors off without a reason, motors
// on again by themselves. The observer gets every tick. Simulation only.
#pragma once

#include <cmath>
#include <memory>

#include "app/io/fault_backend.hpp"
#include "app/io/plant_backend.hpp"
#include "app/run/firmware.hpp"
#include "equipoise/runtime/latest_command.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

enum class Phase : std::size_t { kDisarmed, kArming, kBalancing, kSpinning, kDriving, kCount };
inline constexpr std::array<const char*, static_cast<std::size_t>(Phase::kCount)> kPhaseNames{
    "disarmed", "arming", "balancing", "spinning", "driving"};

struct FaultOutcome {
  bool unsafe = false;
  const char* why = "";
  bool disarmed = false;      // motors went off
  int off_after_ticks = -1;   // of the fault
  std::uint32_t reasons = 0;  // when they went off, or why they never went on
  bool off_without_fault = false;
};

struct FaultPlan {
  Phase phase = Phase::kBalancing;
  FaultKind fault = FaultKind::kImuOff;
  int fault_at_tick = 500;
  int fault_ticks = 1 << 20;
  int end_tick = 1100;
};

constexpr int kArmTick = 100;

inline Command command_in(Phase phase, int tick) {
  Command command;
  command.arm = phase != Phase::kDisarmed && tick >= kArmTick;
  if (tick > kArmTick + 100 && phase == Phase::kSpinning) command.yaw_rate_rad_s = 2.0 * kPi;
  if (tick > kArmTick + 100 && phase == Phase::kDriving) command.velocity_W_m_s = Vec2(0.1, 0.0);
  return command;
}

/// Tick by tick: was what the motors did safe?
class FaultJudge {
 public:
  FaultJudge(const FaultPlan& plan, double max_tilt_rad) : plan_(plan), max_tilt_rad_(max_tilt_rad) {}

  /// The fault strikes before the next tick.
  void strike() { struck_while_on_ = was_on_; }

  /// `active`: the fault lasts; `seen`: the controlling estimate.
  template <class Result>
  void judge(std::int64_t tick, const Command& command, const Result& t, bool active, const StateView& seen,
             const StateView& truth) {
    const FaultInfo& info = kFaults[static_cast<std::size_t>(plan_.fault)];
    const int since = static_cast<int>(tick) - plan_.fault_at_tick;  // 0: the first spoilt tick
    const bool on = t.motors.enable;
    lying_ = on && truth.theta_rad.head<2>().norm() > max_tilt_rad_ ? lying_ + 1 : 0;
    const double error = (seen.theta_rad - truth.theta_rad).head<2>().norm();
    wrong_ = on && !(error < kWrongTilt_rad) ? wrong_ + 1 : 0;
    if (lying_ > kDeadlineTicks) unsafe("motors on while lying");
    if (wrong_ > kDeadlineTicks) unsafe("wrong tilt unnoticed");
    const bool must_be_off = info.deadline_ticks > 0 && (struck_while_on_ || !info.once);
    if (on && active && must_be_off && since >= info.deadline_ticks) unsafe("duty after the deadline");
    if (on && outcome_.disarmed) unsafe("armed again by itself");
    if (on && !command.arm) unsafe("motors on unasked");
    if (!on && t.reasons == 0) unsafe("motors off without a reason");
    if (was_on_ && !on) {
      outcome_.disarmed = true;
      outcome_.off_after_ticks = since + 1;
      outcome_.reasons = t.reasons;
      outcome_.off_without_fault = since < 0;
    } else if (!was_on_ && !outcome_.disarmed) {
      outcome_.reasons = t.reasons;
    }
    was_on_ = on;
  }

  FaultOutcome outcome() const {
    FaultOutcome out = outcome_;
    if (was_on_) out.reasons = 0;
    return out;
  }

 private:
  static constexpr double kWrongTilt_rad = 0.35;
  void unsafe(const char* why) {
    if (!outcome_.unsafe) outcome_.why = why;
    outcome_.unsafe = true;
  }

  const FaultPlan& plan_;
  double max_tilt_rad_;
  FaultOutcome outcome_;
  bool was_on_ = false;
  bool struck_while_on_ = false;
  int lying_ = 0;
  int wrong_ = 0;
};

/// `observe(tick, now_ns, raw, command, result)` as of the loop.
template <class World, class Pipeline, class Observe>
FaultOutcome run_with_fault(World& world, Pipeline& pipeline, const FaultPlan& plan, std::uint64_t seed,
                            Observe&& observe) {
  PlantBackend<World> plant(world);
  FaultBackend faulty(plant.io(), seed);
  Hardware hardware(faulty.io());
  runtime::Supervisor supervisor({nullptr, 0, &faulty.log_failed(), true});
  runtime::LatestCommand remote;
  const auto& robot = pipeline.params().robot;
  FaultJudge judge(plan, pipeline.params().safety.max_tilt_rad);
  std::atomic<bool> done{false};

  const auto commands = [&](std::int64_t tick, std::int64_t now_ns) {
    pipeline.estimators().observe_truth(world.truth());
    if (!faulty.remote_silent()) remote.renew(command_in(plan.phase, static_cast<int>(tick)), now_ns);
    return remote.at(now_ns);
  };
  const auto on_tick = [&](std::int64_t tick, std::int64_t now_ns, const RawSample& raw,
                           const Command& command, const typename Pipeline::Result& t) {
    judge.judge(tick, command, t, faulty.active(), view(t.x_hat, robot), view(world.truth(), robot));
    observe(tick, now_ns, raw, command, t);
    if (tick + 1 == plan.fault_at_tick) {
      faulty.start(plan.fault, plan.fault_ticks);
      judge.strike();
    }
    done = tick + 1 >= plan.end_tick;
  };
  (void)runtime::run_loop(hardware, pipeline, commands, on_tick, done, supervisor);
  return judge.outcome();
}

}  // namespace equipoise::app
