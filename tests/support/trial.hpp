// One trial of any robot through loop, pipeline and world, in which a test may spoil every sample before the
// pipeline sees it. The same code for every robot: types come from its Firmware.
#pragma once

#include <string>

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
};

/// Half a second at rest, then armed for `seconds` or until the motors go off. `interfere(RawSample&)`: every
/// tick.
template <class Firmware, class Interfere>
TrialEnd run_trial(const app::Choice& choice, std::uint64_t seed, double seconds, Interfere&& interfere,
                   const std::vector<std::string>& set = {}) {
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
    return command;
  };
  const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&, const auto& t) {
    end = {static_cast<ArmState>(t.arm_state), t.reasons, end.degraded | t.degraded,
           static_cast<double>(tick - kRestTicks) * kTickS};
    done = tick > kRestTicks && !t.motors.enable;
  };
  SteppedIo io(hardware, kRestTicks + static_cast<std::int64_t>(seconds * kTickHz), interfere);
  (void)runtime::run_loop(io, *firmware, commands, on_tick, done);
  return end;
}

}  // namespace equipoise
