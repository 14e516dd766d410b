// The MBBR as sim, run and replay build it: names, defaults, configuration, pipeline, world. One line of
// robots/robot_list.hpp names it. Start-up only.
#pragma once

#include <string>
#include <vector>

#include "robots/common/firmware.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mbbr/world.hpp"

namespace equipoise {

struct MbbrFirmware : FirmwareBase<Mbbr, MbbrConfig, MbbrWorld> {
  using EngineWorld = MbbrEngineWorld;
  static constexpr const char* kName = "mbbr";
  static constexpr const char* kDefaultEstimator = "ekf";
  static constexpr const char* kDefaultController = "scheduled";
  static constexpr const char* kSpeedRmseKey = "ball_speed_rmse_m_s";
  static constexpr const char* kSpeedLabel = "ball speed RMSE";
  static constexpr const char* kSpeedUnit = "cm/s";
  static constexpr double kSpeedScale = 100.0;
  static constexpr bool kDrivesSideways = true;
  static constexpr double kForward_rad = 0.0;  // heading of a drive forward at yaw 0, from x

  static constexpr auto load = load_mbbr;
  static constexpr auto parse = parse_mbbr;
  static std::vector<std::string> estimators() {
    return {kMbbrEstimatorNames.begin(), kMbbrEstimatorNames.end()};
  }
  static std::vector<std::string> controllers() { return {"thesis", "scheduled"}; }

  /// The configuration with the choices applied, as it runs.
  static Config apply(const Config& configured, const Choice& choice) {
    return with_choice(configured, choice, kMbbrEstimatorNames, MbbrEstimatorId::kEkf13Published,
                       MbbrEstimatorId::kKfAttitude);
  }

  /// f(pipeline); the controller decides its type.
  template <class F>
  static auto with_pipeline(const Config& config, const std::string& controller, F&& f) {
    if (controller == "thesis") {
      MbbrThesisPipeline pipeline(config.thesis_pipeline());
      return f(pipeline);
    }
    MbbrScheduledPipeline pipeline(config.scheduled_pipeline());
    return f(pipeline);
  }
};

}  // namespace equipoise
