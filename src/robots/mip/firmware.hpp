// The eduMIP as sim, run and replay build it: names, defaults, configuration, pipeline, world. One line of
// robots/robot_list.hpp names it. Start-up only.
#pragma once

#include <string>
#include <vector>

#include "robots/common/firmware.hpp"
#include "robots/mip/config.hpp"
#include "robots/mip/world.hpp"

namespace equipoise {

struct MipFirmware : FirmwareBase<Mip, MipConfig, MipWorld> {
  using EngineWorld = MipEngineWorld;
  static constexpr const char* kName = "mip";
  static constexpr const char* kDefaultEstimator = "ekf";
  static constexpr const char* kDefaultController = "slc";
  static constexpr const char* kSpeedRmseKey = "wheel_speed_rmse_rad_s";
  static constexpr const char* kSpeedLabel = "wheel speed RMSE";
  static constexpr const char* kSpeedUnit = "rad/s";
  static constexpr double kSpeedScale = 1.0;
  static constexpr bool kDrivesSideways = false;
  static constexpr double kForward_rad = -0.5 * kPi;  // heading of a drive forward at yaw 0, from x

  static constexpr auto load = load_mip;
  static constexpr auto parse = parse_mip;
  static std::vector<std::string> estimators() {
    return {kMipEstimatorNames.begin(), kMipEstimatorNames.end()};
  }
  static std::vector<std::string> controllers() { return {"slc", "lqr"}; }

  /// The configuration with the choices applied, as it runs.
  static Config apply(const Config& configured, const Choice& choice) {
    return with_choice(configured, choice, kMipEstimatorNames, MipEstimatorId::kEkfPublished,
                       MipEstimatorId::kAttitude);
  }

  /// f(pipeline); the controller decides its type.
  template <class F>
  static auto with_pipeline(const Config& config, const std::string& controller, F&& f) {
    if (controller == "slc") {
      MipSlcPipeline pipeline(config.slc_pipeline());
      return f(pipeline);
    }
    MipLqrPipeline pipeline(config.lqr_pipeline());
    return f(pipeline);
  }
};

}  // namespace equipoise
