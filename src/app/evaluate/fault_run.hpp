// One run with one injected fault through the production loop and supervisor, and whether it was safe. In:
// world, firmware, phase, fault, seed -> out: what the motors and the robot did. Judged in every tick from
// the plant's truth. Unsafe: duty after the fault's deadline, duty on a robot that lies, faster than 0.6 m/s
// or half a metre further than asked with motors on, an estimate that is wrong while motors run, motors off
// without a reason, motors on again by themselves. The observer gets every tick. Simulation only.
#pragma once

#include <functional>

#include "app/io/fault_backend.hpp"
#include "app/trial/firmware.hpp"

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

/// `observe` gets every tick's record.
FaultOutcome run_with_fault(World& world, Firmware& firmware, const FaultPlan& plan, double max_tilt_rad,
                            std::uint64_t seed,
                            const std::function<void(const runtime::TickRecord&)>& observe = {});
/// The same of a robot's own world and firmware.
FaultOutcome run_with_fault(const ConfiguredRobot& robot, const Choice& choice, const FaultPlan& plan,
                            std::uint64_t seed,
                            const std::function<void(const runtime::TickRecord&)>& observe = {});

}  // namespace equipoise::app
