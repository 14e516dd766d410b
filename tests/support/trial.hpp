// One trial of any robot through loop, pipeline and world, in which a test may spoil every sample before the
// pipeline sees it. The same code for every robot: types come from its Firmware.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "app/io/plant_backend.hpp"
#include "app/trial/firmware.hpp"
#include "equipoise/runtime/loop.hpp"
#include "support/config_files.hpp"
#include "support/stepped_io.hpp"

namespace equipoise {

struct TrialEnd {
  ArmState arm_state = ArmState::kDisarmed;
  std::uint32_t reasons = 0;
  std::uint32_t degraded = 0;  // DegradedBit, of any tick
  double ended_at_s = 0.0;     // after arming; the motors' last tick
  double most_tilt_rad = 0.0;  // true, with the motors on
};

/// Half a second at rest, then armed for `seconds` or until the motors go off, driven at `drive_m_s` after
/// half a second more. `interfere(RawSample&)`: every tick.
template <class Firmware, class Interfere>
TrialEnd run_trial(const app::Choice& choice, std::uint64_t seed, double seconds, Interfere&& interfere,
                   const std::vector<std::string>& set = {}, double drive_m_s = 0.0) {
  const auto robot = type_of<Firmware>().load(config_file<Firmware>(), set);
  const auto firmware = robot->firmware(choice);
  const auto world = robot->world(choice, seed);
  app::PlantBackend backend(*world);
  app::Hardware hardware(backend.io());
  constexpr std::int64_t kRestTicks = 100;
  TrialEnd end;
  std::atomic<bool> done{false};
  const auto commands = [&](std::int64_t tick, std::int64_t) {
    firmware->observe_truth(*world);
    Command command;
    command.arm = tick >= kRestTicks;
    if (tick >= 2 * kRestTicks) command.velocity_W_m_s.x() = drive_m_s;
    return command;
  };
  const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&, const auto& t) {
    const double tilt = t.motors.enable ? world->truth().theta_rad.template head<2>().norm() : 0.0;
    end = {static_cast<ArmState>(t.arm_state), t.reasons, end.degraded | t.degraded,
           static_cast<double>(tick - kRestTicks) * kTickS, std::max(end.most_tilt_rad, tilt)};
    done = tick > kRestTicks && !t.motors.enable;
  };
  SteppedIo io(hardware, kRestTicks + static_cast<std::int64_t>(seconds * kTickHz), interfere);
  (void)runtime::run_loop(io, *firmware, commands, on_tick, done);
  return end;
}

}  // namespace equipoise
