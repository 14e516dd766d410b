// A simulated run as it is asked for, and its figures under the names that users know: one place for the
// command line and the Python package. In: request -> out: configuration of the drawn robot, JSON. Start-up
// and end only.
#pragma once

#include <string>
#include <vector>

#include "app/sim/simulate.hpp"
#include "app/text/json.hpp"
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
  std::string fault;  // NAME@T or NAME@T+D; empty: none
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
std::unique_ptr<const ConfiguredRobot> load_for(SimRequest* request,
                                                std::vector<config::Drawn>* drawn = nullptr);

SimOptions options_for(const SimRequest& request, const ConfiguredRobot& robot);

/// One number by name; elements of an array are name[0], name[1], ...
nlohmann::json by_name(const std::vector<config::Drawn>& drawn);

/// What a run came to, without what was asked for. NaN, never counted, is written as null.
nlohmann::json figures(const RobotType& robot, const SimSummary& s);
nlohmann::json to_json(const SimRequest& request, const SimSummary& s, const ConfiguredRobot& robot);

}  // namespace equipoise::app
