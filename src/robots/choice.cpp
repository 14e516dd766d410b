#include "robots/choice.hpp"

#include <algorithm>

namespace equipoise {

std::size_t fidelity_level(const std::string& name) {
  const auto level = std::find(kFidelityNames.begin(), kFidelityNames.end(), name);
  if (level == kFidelityNames.end()) throw ConfigError("fidelity \"" + name + "\" is unknown");
  return static_cast<std::size_t>(level - kFidelityNames.begin());
}

void allow_another_robot(SafetyParams* safety) {
  safety->max_identical_samples = 0;
  safety->max_innovation = std::max(safety->max_innovation, safety->max_innovation_published);
}

double gyro_delay_s(const WorldParams& world) {
  return world.imu_low_pass > 0 ? imu_gyro_delay_s(world.imu_low_pass) : 0.0;
}

}  // namespace equipoise
