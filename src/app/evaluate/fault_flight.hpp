// One flight with one fault, tick by tick, and the verdict. In: robot, controller, phase, fault, seed -> out:
// what the motors did and whether that was safe. Unsafe: duty after the fault's deadline, duty on a robot
// that lies, an estimate that is wrong while motors run, motors off without a reason, motors on again by
// themselves.
#pragma once

#include <cmath>
#include <memory>

#include "app/io/fault_backend.hpp"
#include "app/io/plant_backend.hpp"
#include "app/run/firmware.hpp"
#include "equipoise/runtime/timing.hpp"

namespace equipoise::app {

enum class Phase : std::size_t { kDisarmed, kArming, kBalancing, kSpinning, kDriving, kCount };
inline constexpr std::array<const char*, static_cast<std::size_t>(Phase::kCount)> kPhaseNames{
    "disarmed", "arming", "balancing", "spinning", "driving"};

struct Verdict {
  bool unsafe = false;
  const char* why = "";
  bool disarmed = false;      // motors went off
  int off_after_ticks = -1;   // of the fault
  std::uint32_t reasons = 0;  // when they went off, or why they never went on
  bool fell_without_fault = false;
};

struct FlightPlan {
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

template <class World, class Pipeline>
Verdict fly_with_fault(World& world, Pipeline& pipeline, const FlightPlan& plan, std::uint64_t seed) {
  PlantBackend<World> plant(world);
  FaultBackend faulty(plant.io(), seed);
  Hardware hardware(faulty.io());
  runtime::LoopTiming timing({});
  const auto& robot = pipeline.params().robot;
  const FaultInfo& info = kFaults[static_cast<std::size_t>(plan.fault)];
  const double max_tilt = pipeline.params().safety.max_tilt_rad;
  constexpr double kWrongTilt_rad = 0.35;

  Verdict v;
  bool was_on = false;
  bool struck_while_on = false;
  int lying = 0;
  int wrong = 0;
  int write_error = 0;
  double command_age_s = 0.0;
  const auto unsafe = [&v](const char* why) {
    if (!v.unsafe) v.why = why;
    v.unsafe = true;
  };
  for (int tick = 0; tick < plan.end_tick; ++tick) {
    if (tick == plan.fault_at_tick) {
      faulty.start(plan.fault, plan.fault_ticks);
      struck_while_on = was_on;
    }
    std::int64_t now_ns = 0;
    if (hardware.wait_tick(&now_ns) != 0) break;
    const RawSample raw = hardware.read();
    timing.begin(now_ns, raw.t_ns);
    std::uint32_t inhibit = timing.overrun() ? kOverrun : 0U;
    const bool active = faulty.active();
    if (write_error != 0) inhibit |= kWriteFailed;
    if (active && plan.fault == FaultKind::kLogFull) inhibit |= kLogFailed;
    Command command = command_in(plan.phase, tick);
    command_age_s = active && plan.fault == FaultKind::kRemoteLost ? command_age_s + kTickS : 0.0;
    command.age_s = command_age_s;
    pipeline.estimators().observe_truth(world.truth());
    const auto t = pipeline.tick(raw, command, inhibit);
    write_error = hardware.write(t.motors);
    timing.end(now_ns);

    const int since = tick - plan.fault_at_tick;  // 0: the first spoilt tick
    const StateView truth = view(world.truth(), robot);
    const bool on = t.motors.enable;
    lying = on && truth.theta_rad.template head<2>().norm() > max_tilt ? lying + 1 : 0;
    const StateView seen = view(t.x_hat, robot);
    const double error = (seen.theta_rad - truth.theta_rad).template head<2>().norm();
    wrong = on && !(error < kWrongTilt_rad) ? wrong + 1 : 0;
    if (lying > kDeadlineTicks) unsafe("motors on while lying");
    if (wrong > kDeadlineTicks) unsafe("wrong tilt unnoticed");
    const bool must_be_off = info.deadline_ticks > 0 && (struck_while_on || !info.once);
    if (on && active && must_be_off && since >= info.deadline_ticks) unsafe("duty after the deadline");
    if (on && v.disarmed) unsafe("armed again by itself");
    if (on && !command.arm) unsafe("motors on unasked");
    if (!on && t.reasons == 0) unsafe("motors off without a reason");
    if (was_on && !on) {
      v.disarmed = true;
      v.off_after_ticks = since + 1;
      v.reasons = t.reasons;
      v.fell_without_fault = since < 0;
    } else if (!was_on && !v.disarmed) {
      v.reasons = t.reasons;
    }
    was_on = on;
  }
  if (was_on) v.reasons = 0;
  return v;
}

}  // namespace equipoise::app
