#include "app/evaluate/fault_run.hpp"

#include "app/io/plant_backend.hpp"
#include "equipoise/actuate/degraded.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/supervisor.hpp"
#include "equipoise/samples.hpp"

namespace equipoise::app {
namespace {

Command command_in(Phase phase, int tick) {
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

  /// `active`: the fault lasts.
  void judge(std::int64_t tick, const runtime::TickRecord& t, bool active, const StateView& truth) {
    const FaultInfo& info = kFaults[static_cast<std::size_t>(plan_.fault)];
    const int since = static_cast<int>(tick) - plan_.fault_at_tick;  // 0: the first spoilt tick
    const bool on = t.motors.enable;
    const StateView seen = runtime::to_view(t.estimate);
    const bool armed =
        t.arm_state == static_cast<std::int32_t>(ArmState::kArmed);  // for a tick it may let go
    moved(since, t, on, truth.position_W_m);
    if (since >= 0) outcome_.degraded |= t.degraded;
    if (since >= 0 && outcome_.found_after_ticks < 0 && (t.degraded & kSensorsJudged) != 0)
      outcome_.found_after_ticks = since + 1;
    outcome_.upright = armed && truth.theta_rad.head<2>().norm() < max_tilt_rad_;
    lying_ = on && truth.theta_rad.head<2>().norm() > max_tilt_rad_ ? lying_ + 1 : 0;
    const double error = (seen.theta_rad - truth.theta_rad).head<2>().norm();
    wrong_ = on && !(error < kWrongTilt_rad) ? wrong_ + 1 : 0;
    if (lying_ > kDeadlineTicks) unsafe("motors on after a fall");
    if (wrong_ > kDeadlineTicks) unsafe("wrong tilt unnoticed");
    if (on && active && info.deadline_ticks > 0 && since >= info.deadline_ticks)
      unsafe("duty after the deadline");
    if (on && outcome_.disarmed) unsafe("armed again by itself");
    if (on && !t.arm) unsafe("motors on unasked");
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
  void moved(int since, const runtime::TickRecord& t, bool on, const Vec2& position_W_m) {
    if (since <= 0) {
      from_W_m_ = position_W_m;
    } else {
      asked_m_ += kTickS * Vec2(t.velocity_W_m_s.data()).norm();
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
  int lying_ = 0;
  int wrong_ = 0;
  Vec2 position_W_m_ = Vec2::Zero();
  Vec2 from_W_m_ = Vec2::Zero();  // where the fault struck
  double asked_m_ = 0.0;          // of way since then
};

}  // namespace

FaultOutcome run_with_fault(World& world, Firmware& firmware, const FaultPlan& plan, double max_tilt_rad,
                            std::uint64_t seed,
                            const std::function<void(const runtime::TickRecord&)>& observe) {
  PlantBackend plant(world);
  FaultBackend faulty(plant.io(), seed);
  Hardware hardware(faulty.io());
  runtime::Supervisor supervisor({nullptr, 0, &faulty.log_failed(), true});
  Command newest;
  std::int64_t came_ns = 0;  // and when it came
  FaultJudge judge(plan, max_tilt_rad);
  std::atomic<bool> done{false};

  const auto commands = [&](std::int64_t tick, std::int64_t now_ns) {
    firmware.observe_truth(world);
    if (!faulty.remote_silent()) {
      newest = command_in(plan.phase, static_cast<int>(tick));
      came_ns = now_ns;
    }
    newest.age_s = 1e-9 * static_cast<double>(now_ns - came_ns);
    return newest;
  };
  const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&,
                           const runtime::TickRecord& t) {
    judge.judge(tick, t, faulty.active(), world.truth());
    if (observe) {
      runtime::TickRecord record = t;
      record.tick = tick;
      observe(record);
    }
    if (tick + 1 == plan.fault_at_tick) {
      const int lasts = kFaults[static_cast<std::size_t>(plan.fault)].ticks;
      faulty.start(plan.fault, lasts > 0 ? lasts : plan.fault_ticks);
    }
    done = tick + 1 >= plan.end_tick;
  };
  (void)runtime::run_loop(hardware, firmware, commands, on_tick, done, supervisor);
  return judge.outcome();
}

FaultOutcome run_with_fault(const ConfiguredRobot& robot, const Choice& choice, const FaultPlan& plan,
                            std::uint64_t seed,
                            const std::function<void(const runtime::TickRecord&)>& observe) {
  const auto world = robot.world(choice, seed);
  return run_with_fault(*world, *robot.firmware(choice), plan, robot.safety.max_tilt_rad, seed, observe);
}

}  // namespace equipoise::app
