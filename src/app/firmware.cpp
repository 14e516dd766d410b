#include "firmware.hpp"

#include <algorithm>

namespace equipoise::app {

std::string version() { return EQUIPOISE_VERSION; }

MbbrConfig MbbrFirmware::apply(const MbbrConfig& configured, const Choice& choice) {
  MbbrConfig config = configured;
  for (std::size_t i = 0; i < kMbbrEstimatorNames.size(); ++i) {
    if (choice.estimator == kMbbrEstimatorNames[i])
      config.estimators.active = static_cast<MbbrEstimatorId>(i);
  }
  config.estimators.compare = choice.compare;
  config.safety.needs_attitude = config.estimators.active == MbbrEstimatorId::kKfAttitude;
  // In simulation the firmware is configured for the robot it is on: the level's bridge, and no compensation
  // of absent friction.
  const auto level = std::find(kFidelityNames.begin(), kFidelityNames.end(), choice.fidelity);
  if (level != kFidelityNames.end()) {
    const auto i = static_cast<std::size_t>(level - kFidelityNames.begin());
    config.motor.bridge = config.world_bridge[i];
    if (!config.world[i].friction) config.friction.gain = 0.0;
  }
  return config;
}

}  // namespace equipoise::app
