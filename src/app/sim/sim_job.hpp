// A simulated run as it is asked for, and its figures under the names that users know: one place for the
// command line and the Python package. In: request -> out: configuration of the drawn robot, JSON. Start-up
// and end only.
#pragma once

#include <string>
#include <vector>

#include "app/sim/simulate.hpp"
#include "app/text/json.hpp"
#include "app/text/reasons.hpp"
#include "config/population.hpp"

namespace equipoise::app {

struct SimRequest {
  std::string config;  // a file
  std::vector<std::string> set;
  std::int64_t robot = 0;  // of [population]; 0: the typical one
  Choice choice{"", "", "nominal", false, "dmp", ""};
  double yaw_rate_rad_s = 0.0;
  double drive_mps = 0.0;
  std::string path;
  double duration_s = 30.0;
  std::uint64_t seed = 1;
};

// What may be asked for, from -limit to limit.
inline constexpr double kMostYaw_hz = 5.0;
inline constexpr double kMostDrive_mps = 2.0;
inline constexpr double kShortest_s = 0.01;
inline constexpr double kLongest_s = 360000.0;

/// InputError for what the command line refuses by its options' ranges.
void check(const SimRequest& request);

/// Completes the request's choices; ConfigError where they or the configuration are wrong. `drawn`, where
/// wanted: the robot's imperfections.
template <class Firmware>
typename Firmware::Loaded load_for(SimRequest* request, std::vector<config::Drawn>* drawn = nullptr) {
  complete<Firmware>(request->choice);
  const std::vector<config::Drawn> robot =
      config::draw_robot(request->config, request->set, request->choice.fidelity, request->robot);
  if (drawn != nullptr) *drawn = robot;
  return Firmware::load(request->config,
                        config::with_robot_drawn(robot, request->choice.fidelity, request->set));
}

template <class Firmware>
SimOptions options_for(const SimRequest& request, const typename Firmware::Config& config) {
  SimOptions options;
  options.script = script_for<Firmware>(config, request.drive_mps, request.yaw_rate_rad_s, request.path);
  options.duration_s = request.duration_s;
  options.seed = request.seed;
  return options;
}

/// One number by name; elements of an array are name[0], name[1], ...
nlohmann::json by_name(const std::vector<config::Drawn>& drawn);

/// What a run came to, without what was asked for. NaN, never counted, is written as null.
template <class Firmware>
nlohmann::json figures(const SimSummary& s) {
  nlohmann::json out{{"attitude_rmse_rad", s.controlling.attitude_rmse_rad},
                     {Firmware::kSpeedRmseKey, s.controlling.speed_rmse},
                     {"yaw_frame_speed_rmse_m_s", s.yaw_frame_speed_rmse_m_s},
                     {"heading_error_rad", s.heading_error_rad},
                     {"position_rmse_m", s.position_rmse_m},
                     {"normalized_innovation_mean", s.normalized_innovation_mean},
                     {"yaw_rate_mean_hz", s.yaw_rate_mean_hz},
                     {"duty_max", s.duty_max},
                     {"saturated_fraction", s.saturated_fraction},
                     {"degraded", degraded_names(s.degraded)}};
  s.verdict.write(&out);
  return out;
}

template <class Firmware>
nlohmann::json to_json(const SimRequest& request, const SimSummary& s, const std::string& config_sha256) {
  nlohmann::json estimators = nlohmann::json::object();
  for (const auto& [name, errors] : s.estimators) {
    estimators[name] = {{"attitude_rmse_rad", errors.attitude_rmse_rad},
                        {Firmware::kSpeedRmseKey, errors.speed_rmse}};
  }
  nlohmann::json out{{"robot", Firmware::kName},
                     {"robot_number", request.robot},
                     {"seed", request.seed},
                     {"estimator", request.choice.estimator},
                     {"controller", request.choice.controller},
                     {"fidelity", request.choice.fidelity},
                     {"attitude", request.choice.attitude},
                     {"yaw_hz", request.yaw_rate_rad_s / (2.0 * kPi)},
                     {"drive_mps", request.drive_mps},
                     {"duration_s", static_cast<double>(s.ticks) * kTickS},
                     {"path", request.path.empty() ? nlohmann::json(nullptr) : nlohmann::json(request.path)},
                     {"path_rmse_m", s.path_rmse_m},
                     {"ticks", s.ticks},
                     {"real_time_factor", s.real_time_factor},
                     {"interrupted", s.verdict.ended == Ended::kInterrupted},
                     {"estimators", estimators},
                     {"config_sha256", config_sha256},
                     {"version", version()}};
  out.update(figures<Firmware>(s));
  return out;
}

}  // namespace equipoise::app
