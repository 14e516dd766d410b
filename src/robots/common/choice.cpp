#include "robots/common/choice.hpp"

#include <limits>

namespace equipoise {

std::size_t fidelity_level(const std::string& name) {
  const auto level = std::find(kFidelityNames.begin(), kFidelityNames.end(), name);
  if (level == kFidelityNames.end()) throw ConfigError("fidelity \"" + name + "\" is unknown");
  return static_cast<std::size_t>(level - kFidelityNames.begin());
}

void doubt_nothing(const Choice& choice, SafetyParams* safety) {
  if (choice.fidelity.empty() && choice.backend != "lockstep")
    throw ConfigError(
        "safety.detection = false: simulated robots only; a real one keeps its fault detection");
  constexpr double kNever = std::numeric_limits<double>::infinity();
  safety->max_innovation = kNever;
  safety->max_tilt_sigma_rad = kNever;
  safety->max_bias_drift_rad_s = kNever;
  safety->max_motor_error = kNever;
  safety->encoder_check_drive = 0.0;
  safety->encoder_probe_drive = 0.0;
}

}  // namespace equipoise
