#include "app/run/firmware.hpp"

#include <algorithm>

namespace equipoise::app {

std::string version() { return EQUIPOISE_VERSION; }

namespace {

std::string joined(const std::string& robot, const std::vector<std::string>& names) {
  std::string text = robot + ":";
  for (const std::string& name : names) text += (&name == &names.front() ? " " : ", ") + name;
  return text;
}

}  // namespace

std::string known_estimators() {
  return joined(MbbrFirmware::kName, MbbrFirmware::estimators()) + "; " +
         joined(MipFirmware::kName, MipFirmware::estimators());
}
std::string known_controllers() {
  return joined(MbbrFirmware::kName, MbbrFirmware::controllers()) + "; " +
         joined(MipFirmware::kName, MipFirmware::controllers());
}

std::size_t fidelity_level(const std::string& name) {
  const auto level = std::find(kFidelityNames.begin(), kFidelityNames.end(), name);
  if (level == kFidelityNames.end()) throw ConfigError("fidelity \"" + name + "\" is unknown");
  return static_cast<std::size_t>(level - kFidelityNames.begin());
}

namespace {

/// An engine's IMU may be noiseless and stand still, and its robot is not the one the filters were tuned on.
void allow_another_robot(SafetyParams* safety) {
  safety->max_identical_samples = 0;
  safety->max_innovation = std::max(safety->max_innovation, safety->max_innovation_published);
}

/// What the firmware is told of the simulated IMU: its register, not what this chip makes of it.
double gyro_delay_s(const WorldParams& world) {
  return world.imu_low_pass > 0 ? imu_gyro_delay_s(world.imu_low_pass) : 0.0;
}

}  // namespace

MbbrConfig MbbrFirmware::apply(const MbbrConfig& configured, const Choice& choice) {
  MbbrConfig config = configured;
  for (std::size_t i = 0; i < kMbbrEstimatorNames.size(); ++i) {
    if (choice.estimator == kMbbrEstimatorNames[i])
      config.estimators.active = static_cast<MbbrEstimatorId>(i);
  }
  config.estimators.compare = choice.compare;
  if (!choice.attitude.empty()) config.attitude.own = choice.attitude == "own";
  config.safety.needs_attitude = config.estimators.active == MbbrEstimatorId::kKfAttitude;
  if (config.estimators.active == MbbrEstimatorId::kEkf13Published)
    config.safety.max_innovation = config.safety.max_innovation_published;
  if (choice.backend == "lockstep") allow_another_robot(&config.safety);
  // In simulation the firmware is configured for the robot it is on: the level's bridge and IMU, no
  // compensation of absent friction.
  if (!choice.fidelity.empty()) {
    const std::size_t i = fidelity_level(choice.fidelity);
    config.motor.bridge = config.world_bridge[i];
    config.estimators.ekf.sensor_age_s = gyro_delay_s(config.world[i].common);
    if (!config.world[i].common.friction) config.friction.gain = 0.0;
    if (config.world[i].common.gyro_sigma_rad_s == 0.0) config.safety.max_identical_samples = 0;
  }
  return config;
}

MipConfig MipFirmware::apply(const MipConfig& configured, const Choice& choice) {
  MipConfig config = configured;
  for (std::size_t i = 0; i < kMipEstimatorNames.size(); ++i) {
    if (choice.estimator == kMipEstimatorNames[i]) config.estimators.active = static_cast<MipEstimatorId>(i);
  }
  config.estimators.compare = choice.compare;
  if (!choice.attitude.empty()) config.attitude.own = choice.attitude == "own";
  config.safety.needs_attitude = config.estimators.active == MipEstimatorId::kAttitude;
  if (config.estimators.active == MipEstimatorId::kEkfPublished)
    config.safety.max_innovation = config.safety.max_innovation_published;
  if (choice.backend == "lockstep") allow_another_robot(&config.safety);
  if (!choice.fidelity.empty()) {
    const std::size_t i = fidelity_level(choice.fidelity);
    config.motor.bridge = config.world_bridge[i];
    config.estimators.ekf.sensor_age_s = gyro_delay_s(config.world[i].common);
    if (!config.world[i].common.friction) config.friction.gain = 0.0;
    if (config.world[i].common.gyro_sigma_rad_s == 0.0) config.safety.max_identical_samples = 0;
  }
  return config;
}

}  // namespace equipoise::app
