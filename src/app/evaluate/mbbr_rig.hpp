// The MBBR in its simulated world behind the hardware boundary, with the firmware configured for that world.
// In: configuration, fidelity, seed -> out: world, backend, pipeline, ready for a loop or for single ticks.
// Used by the fault campaign, the soak and tests. Simulation only; allocates nothing after construction.
#pragma once

#include "app/io/plant_backend.hpp"
#include "equipoise/config.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mbbr/world.hpp"

namespace equipoise::app {

struct MbbrRigOptions {
  Fidelity fidelity = Fidelity::kNominal;
  std::uint64_t seed = 1;
  MbbrEstimatorId estimator = MbbrEstimatorId::kEkf;
  bool compare = false;
};

/// The firmware is configured for the robot it is on: the level's bridge, no compensation of absent friction.
inline MbbrConfig configured_for(MbbrConfig config, const MbbrRigOptions& options) {
  const auto level = static_cast<std::size_t>(options.fidelity);
  config.motor.bridge = config.world_bridge[level];
  config.world[level].common.seed = options.seed;
  if (!config.world[level].common.friction) config.friction.gain = 0.0;
  config.estimators.active = options.estimator;
  config.estimators.compare = options.compare;
  config.safety.needs_attitude = options.estimator == MbbrEstimatorId::kKfAttitude;
  if (config.world[level].common.gyro_sigma_rad_s == 0.0)
    config.safety.max_identical_samples = 0;  // noiseless
  return config;
}

inline MbbrThesisPipeline::Params pipeline_params(const MbbrConfig& config, const MbbrThesisPipeline*) {
  return config.thesis_pipeline();
}
inline MbbrScheduledPipeline::Params pipeline_params(const MbbrConfig& config, const MbbrScheduledPipeline*) {
  return config.scheduled_pipeline();
}

template <class ControllerPipeline>
class MbbrRigWith {
 public:
  using Pipeline = ControllerPipeline;

  MbbrRigWith(const MbbrConfig& configured, const MbbrRigOptions& options)
      : config(configured_for(configured, options)),
        world(config.robot, config.motor, config.calibration,
              config.world[static_cast<std::size_t>(options.fidelity)]),
        backend(world),
        pipeline(pipeline_params(config, static_cast<const Pipeline*>(nullptr))) {}

  const MbbrConfig config;
  MbbrWorld world;
  PlantBackend<MbbrWorld> backend;
  Pipeline pipeline;
};

using MbbrRig = MbbrRigWith<MbbrScheduledPipeline>;  // the default controller

}  // namespace equipoise::app
