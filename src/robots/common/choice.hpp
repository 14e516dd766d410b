// What is chosen beside a configuration, and how it changes the configuration as it runs. In: configuration,
// choices -> out: the same, for this estimator, attitude source, world and backend. Start-up only.
#pragma once

#include <algorithm>
#include <array>
#include <string>

#include "equipoise/actuate/safety.hpp"
#include "equipoise/config.hpp"
#include "equipoise/plant/world.hpp"

namespace equipoise {

/// In a log: run_t.
struct Choice {
  std::string estimator;
  std::string controller;
  std::string fidelity;  // of the simulated world; empty on hardware
  bool compare = false;
  std::string attitude{};  // dmp or own; empty: as configured
  std::string backend{};   // of run; empty: sim
};

/// Index of a name of kFidelityNames; ConfigError when it is none.
std::size_t fidelity_level(const std::string& name);

/// The twin of a simulated run, in which only a fall, a limit of the motors or a sensor that is gone ends it;
/// ConfigError on a board.
void doubt_nothing(const Choice& choice, SafetyParams* safety);

/// `names`: of the robot's estimators; `published`: the printed one, which trusts itself more; `packets`: the
/// one that needs the attitude source.
template <class Config, class Id, std::size_t N>
Config with_choice(Config config, const Choice& choice, const std::array<const char*, N>& names, Id published,
                   Id packets) {
  for (std::size_t i = 0; i < N; ++i) {
    if (choice.estimator == names[i]) config.estimators.active = static_cast<Id>(i);
  }
  config.estimators.compare = choice.compare;
  if (!choice.attitude.empty()) config.attitude.own = choice.attitude == "own";
  config.safety.needs_attitude = config.estimators.active == packets;
  if (config.estimators.active == published)
    config.safety.max_innovation = config.safety.max_innovation_published;
  if (choice.backend == "lockstep") {  // its IMU may be noiseless and stand still, its robot another one
    config.safety.max_identical_samples = 0;
    config.safety.max_innovation =
        std::max(config.safety.max_innovation, config.safety.max_innovation_published);
  }
  if (!config.safety.detection) doubt_nothing(choice, &config.safety);
  config.estimators.detection = config.safety.detection;
  // In simulation the firmware is configured for the robot it is on: the level's bridge and IMU, no
  // compensation of absent friction.
  if (!choice.fidelity.empty()) {
    const std::size_t i = fidelity_level(choice.fidelity);
    config.motor.bridge = config.world_bridge[i];
    // Of the simulated IMU its data sheet, not what this chip makes of it.
    config.estimators.ekf.sensor_age_s = config.world[i].common.gyro_delay_s();
    if (!config.world[i].common.friction) config.friction.gain = 0.0;
    if (config.world[i].common.gyro_sigma_rad_s == 0.0) config.safety.max_identical_samples = 0;
  }
  return config;
}

}  // namespace equipoise
