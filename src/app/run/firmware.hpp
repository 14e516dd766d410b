// The firmware of each robot as sim, run and replay build it: configuration, choices, pipeline, tick record.
// In: robot name, configuration, choices -> out: the pipeline that flies. One struct per robot; with_robot is
// the only place that tells them apart. record_tick is RT-safe, the rest is start-up only.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "equipoise/config.hpp"
#include "equipoise/runtime/record.hpp"
#include "equipoise/runtime/telemetry.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mbbr/world.hpp"
#include "robots/mip/config.hpp"

namespace equipoise::app {

/// Of this build.
std::string version();

/// What is chosen beside the configuration; in a log: run_t.
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

struct MbbrFirmware {
  using Robot = Mbbr;
  using Config = MbbrConfig;
  using Loaded = equipoise::Loaded<MbbrConfig>;
  using World = MbbrWorld;
  static constexpr const char* kName = "mbbr";
  static constexpr const char* kDefaultEstimator = "ekf";
  static constexpr const char* kDefaultController = "scheduled";
  static constexpr const char* kSpeedRmseKey = "ball_speed_rmse_m_s";
  static constexpr const char* kSpeedLabel = "ball speed RMSE";
  static constexpr const char* kSpeedUnit = "cm/s";
  static constexpr double kSpeedScale = 100.0;

  static Loaded load(const std::string& path, const Overrides& overrides) {
    return load_mbbr(path, overrides);
  }
  static Loaded parse(const std::string& text, const std::string& origin) { return parse_mbbr(text, origin); }
  static std::vector<std::string> estimators() {
    return {kMbbrEstimatorNames.begin(), kMbbrEstimatorNames.end()};
  }
  static std::vector<std::string> controllers() { return {"thesis", "scheduled"}; }
  static double rolling_radius_m(const Config& c) { return c.robot.r; }

  /// The configuration with the choices applied, as it flies.
  static Config apply(const Config& configured, const Choice& choice);

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

  /// `config` as it flies; `level` of fidelity.
  static World world(const Config& config, std::size_t level, std::uint64_t seed) {
    MbbrWorldParams params = config.world[level];
    params.common.seed = seed;
    return World(config.robot, config.motor, config.calibration, params);
  }
};

struct MipFirmware {
  using Robot = Mip;
  using Config = MipConfig;
  using Loaded = equipoise::Loaded<MipConfig>;
  using World = MipWorld;
  static constexpr const char* kName = "mip";
  static constexpr const char* kDefaultEstimator = "ekf";
  static constexpr const char* kDefaultController = "slc";
  static constexpr const char* kSpeedRmseKey = "wheel_speed_rmse_rad_s";
  static constexpr const char* kSpeedLabel = "wheel speed RMSE";
  static constexpr const char* kSpeedUnit = "rad/s";
  static constexpr double kSpeedScale = 1.0;

  static Loaded load(const std::string& path, const Overrides& overrides) {
    return load_mip(path, overrides);
  }
  static Loaded parse(const std::string& text, const std::string& origin) { return parse_mip(text, origin); }
  static std::vector<std::string> estimators() {
    return {kMipEstimatorNames.begin(), kMipEstimatorNames.end()};
  }
  static std::vector<std::string> controllers() { return {"slc", "lqr"}; }
  static double rolling_radius_m(const Config& c) { return c.robot.r; }

  /// The configuration with the choices applied, as it flies.
  static Config apply(const Config& configured, const Choice& choice);

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

  /// `config` as it flies; `level` of fidelity.
  static World world(const Config& config, std::size_t level, std::uint64_t seed) {
    MipWorldParams params = config.world[level];
    params.common.seed = seed;
    return World(config.robot, config.motor, config.calibration, params);
  }
};

/// f(firmware) for the robot named `type`; ConfigError when there is none. `where`: file, for the message.
template <class F>
auto with_robot(const std::string& type, const std::string& where, F&& f) {
  if (type == MbbrFirmware::kName) return f(MbbrFirmware{});
  if (type == MipFirmware::kName) return f(MipFirmware{});
  throw ConfigError(where + ": robot.type: \"" + type +
                    "\" cannot be flown by this build; allowed: mbbr, mip");
}

/// Of all robots, for help texts: "mbbr: a, b".
std::string known_estimators();
std::string known_controllers();

/// ConfigError unless estimator and controller are known to this robot; empty ones become its defaults.
template <class Firmware>
void complete(Choice& choice) {
  const auto check = [](const std::string& what, const std::string& value,
                        const std::vector<std::string>& names) {
    std::string allowed;
    for (const std::string& name : names) {
      if (name == value) return;
      allowed += (allowed.empty() ? "" : ", ") + name;
    }
    throw ConfigError("--" + what + " " + value + ": not known to " + Firmware::kName +
                      "; allowed: " + allowed);
  };
  if (choice.estimator.empty()) choice.estimator = Firmware::kDefaultEstimator;
  if (choice.controller.empty()) choice.controller = Firmware::kDefaultController;
  check("estimator", choice.estimator, Firmware::estimators());
  check("controller", choice.controller, Firmware::controllers());
}

/// First event of the log.
template <class Firmware>
runtime::RunInfo run_info(const typename Firmware::Loaded& loaded, const Choice& choice, std::int64_t seed) {
  runtime::RunInfo run;
  run.attitude = choice.attitude;
  run.robot = Firmware::kName;
  run.estimator = choice.estimator;
  run.controller = choice.controller;
  run.fidelity = choice.fidelity;
  run.seed = seed;
  run.rolling_radius_m = Firmware::rolling_radius_m(loaded.config);
  run.version = version();
  run.config_sha256 = loaded.sha256;
  run.config_toml = loaded.toml;
  return run;
}

/// Everything of one tick but truth and timing.
template <class Pipeline>
void record_tick(std::int64_t tick, std::int64_t now_ns, const RawSample& raw, const Command& command,
                 const typename Pipeline::Result& t, const Pipeline& pipeline,
                 runtime::TickRecord* record) noexcept {
  const auto& robot = pipeline.params().robot;
  record->tick = tick;
  record->now_ns = now_ns;
  record->raw = raw;
  record->velocity_W_m_s = {command.velocity_W_m_s.x(), command.velocity_W_m_s.y()};
  record->yaw_rate_rad_s = command.yaw_rate_rad_s;
  record->arm = command.arm;
  record->heading_reset = command.heading_reset;
  record->command_age_s = command.age_s;
  record->inhibit = t.inhibit;
  record->estimate = runtime::to_record(view(t.x_hat, robot));
  record->reference = runtime::to_record(view(t.ref, robot));
  using Estimators = std::decay_t<decltype(pipeline.estimators())>;
  constexpr int kInputs = std::decay_t<decltype(t.u_lin)>::RowsAtCompileTime;
  constexpr int kWheels = Pipeline::Wheels::RowsAtCompileTime;
  static_assert(Estimators::kCount <= runtime::kMaxEstimators, "make room in TickRecord::others");
  static_assert(kInputs > 0 && kInputs <= std::tuple_size_v<decltype(record->u_lin)>, "make room in u_lin");
  static_assert(kWheels > 0 && kWheels <= kMaxMotors, "make room in rio_motors_t");
  record->compared = 0;
  for (std::size_t i = 0; i < Estimators::kCount && pipeline.params().estimators.compare; ++i) {
    const auto id = static_cast<typename Estimators::Id>(i);
    record->others[i] = runtime::to_record(view(pipeline.estimators().estimate(id), robot));
    record->compared |= 1U << i;
  }
  record->motors = kWheels;
  record->degraded = t.degraded;
  for (int i = 0; i < kInputs; ++i) {
    record->u_lin[static_cast<std::size_t>(i)] = t.u_lin(i);
    record->u_friction[static_cast<std::size_t>(i)] = t.u_friction(i);
  }
  std::copy(std::begin(t.motors.duty), std::end(t.motors.duty), record->duty.begin());
  record->enable = t.motors.enable;
  record->saturated = t.saturated;
  record->arm_state = static_cast<std::int32_t>(t.arm_state);
  record->reasons = t.reasons;
  record->battery_V = t.z.battery_V;
}

}  // namespace equipoise::app
