// One run with one injected fault through the production loop and supervisor, and whether it was safe. In:
// world, pipeline, phase, fault, seed -> out: what the motors and the robot did. Judged in every tick from
// the plant's truth. Unsafe: duty after the fault's deadline, duty on a robot that lies, faster than 0.6 m/s
// or half a metre further than asked with motors on, an estimate that is wrong while motors run, motors off
// without a reason, motors on again by themselves. The observer gets every tick. Simulation only.
#pragma once

#include <cmath>
#include <memory>

#include "app/io/fault_backend.hpp"
#include "app/io/plant_backend.hpp"
#include "app/trial/firmware.hpp"
#include "equipoise/runtime/latest_command.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {

enum class Phase : std::size_t { kDisarmed, kArming, kBalancing, kSpinning, kDriving, kSpinDriving, kCount };
inline constexpr std::array<const char*, static_cast<std::size_t>(Phase::kCount)> kPhaseNames{
    "disarmed", "arming", "balancing", "spinning", "driving", "spin_driving"};

struct FaultOutcome {
  bool unsafe = false;
  const char* why = "";
  bool upright = false;      // at the end, armed
  bool disarmed = false;     // motors went off
  int off_after_ticks = -1;  // of the fault
  int found_after_ticks =
      -1;  // off, or the faulty part left out (a degraded mode of its own), after the fault
  std::uint32_t degraded = 0;  // since the fault
  std::uint32_t reasons = 0;   // when they went off, or why they never went on
  bool off_without_fault = false;
};

struct FaultPlan {
  Phase phase = Phase::kBalancing;
  FaultKind fault = FaultKind::kImuOff;
  int fault_at_tick = 500;
  int fault_ticks = 1 << 20;  // at most; kFaults has the length of some
  int end_tick = 1100;
};

constexpr int kArmTick = 100;

inline Command command_in(Phase phase, int tick) {
  Command command;
  command.arm = phase != Phase::kDisarmed && tick >= kArmTick;
  const bool both = phase == Phase::kSpinDriving;
  if (tick > kArmTick + 100 && (both || phase == Phase::kSpinning)) command.yaw_rate_rad_s = 2.0 * kPi;
  if (tick > kArmTick + 100 && (both || phase == Phase::kDriving)) command.velocity_W_m_s = Vec2(0.1, 0.0);
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
    const bool armed = t.arm_state == ArmState::kArmed;  // for a tick it may let go
    moved(since, command, on, truth.position_W_m);
    if (since >= 0) outcome_.degraded |= t.degraded;
    if (since >= 0 && outcome_.found_after_ticks < 0 &&
        (t.degraded & kSensorsJudged) != 0)
      outcome_.found_after_ticks = since + 1;
    outcome_.upright = armed && truth.theta_rad.head<2>().norm() < max_tilt_rad_;
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
    if (was_on_ && !armed) {
      outcome_.disarmed = true;
      if (outcome_.found_after_ticks < 0) outcome_.found_after_ticks = since + 1;
      outcome_.off_after_ticks = since + 1;
      outcome_.reasons = t.reasons;
      outcome_.off_without_fault = since < 0;
    } else if (!was_on_ && !outcome_.disarmed) {
      outcome_.reasons = t.reasons;
    }
    was_on_ = armed;
  }

  FaultOutcome outcome() const {
    FaultOutcome out = outcome_;
    if (was_on_) out.reasons = 0;
    return out;
  }

 private:
  static constexpr double kWrongTilt_rad = 0.35;
  static constexpr double kTooFast_m_s = 0.6;
  static constexpr double kUnasked_m = 0.5;

  /// Speed and travel since the fault.
  void moved(int since, const Command& command, bool on, const Vec2& position_W_m) {
    if (since <= 0) {
      from_W_m_ = position_W_m;
    } else {
      asked_m_ += kTickS * command.velocity_W_m_s.norm();
      if (on && (position_W_m - position_W_m_).norm() > kTickS * kTooFast_m_s) unsafe("too fast");
      if (on && (position_W_m - from_W_m_).norm() > asked_m_ + kUnasked_m) unsafe("unasked travel");
    }
    position_W_m_ = position_W_m;
  }

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
  Vec2 position_W_m_ = Vec2::Zero();
  Vec2 from_W_m_ = Vec2::Zero();  // where the fault struck
  double asked_m_ = 0.0;          // of way since then
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
      const int lasts = kFaults[static_cast<std::size_t>(plan.fault)].ticks;
      faulty.start(plan.fault, lasts > 0 ? lasts : plan.fault_ticks);
      judge.strike();
    }
    done = tick + 1 >= plan.end_tick;
  };
  (void)runtime::run_loop(hardware, pipeline, commands, on_tick, done, supervisor);
  return judge.outcome();
}

}  // namespace equipoise::app
