// Any robot through pipeline and world, one tick at a time, so that a test can interfere with the sample
// before the pipeline sees it. The same code for every robot: types come from its Firmware.
#pragma once

#include <string>

#include "app/io/plant_backend.hpp"
#include "app/run/firmware.hpp"

namespace equipoise {

template <class Firmware>
std::string config_file();
template <>
inline std::string config_file<app::MbbrFirmware>() {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";
}
template <>
inline std::string config_file<app::MipFirmware>() {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml";
}

struct FlightEnd {
  ArmState arm_state = ArmState::kDisarmed;
  std::uint32_t reasons = 0;
  double ended_at_s = 0.0;  // after arming; the motors' last tick
};

/// Half a second at rest, then armed for `seconds` or until the motors go off. `interfere(RawSample&)`: every
/// tick.
template <class Firmware, class Interfere>
FlightEnd fly_with(const app::Choice& choice, std::uint64_t seed, double seconds, Interfere&& interfere,
                   const std::vector<std::string>& set = {}) {
  const auto config = Firmware::apply(Firmware::load(config_file<Firmware>(), set).config, choice);
  auto world = Firmware::world(config, app::fidelity_level(choice.fidelity), seed);
  return Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    FlightEnd end;
    MotorCommand motors{};
    constexpr int kRestTicks = 100;
    for (int tick = 0; tick < kRestTicks + static_cast<int>(seconds * kTickHz); ++tick) {
      world.advance(motors);
      RawSample raw = world.sense();
      interfere(raw);
      pipeline.estimators().observe_truth(world.truth());
      Command command;
      command.arm = tick >= kRestTicks;
      const auto t = pipeline.tick(raw, command);
      motors = t.motors;
      end.arm_state = t.arm_state;
      end.reasons = t.reasons;
      end.ended_at_s = (tick - kRestTicks) * kTickS;
      if (tick > kRestTicks && !motors.enable) break;
    }
    return end;
  });
}

}  // namespace equipoise
