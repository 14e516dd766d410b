#include "app/trial/firmware.hpp"

#include "app/text/format.hpp"
#include "app/text/version.hpp"

namespace equipoise::app {
namespace {

/// "mbbr: a, b; mip: c, d".
std::string per_robot(const std::vector<std::string> RobotType::*names) {
  std::string text;
  for (const RobotType* robot : robot_types())
    text += (text.empty() ? "" : "; ") + std::string(robot->name) + ": " + joined(robot->*names);
  return text;
}

}  // namespace

const RobotType& robot_type_of(const std::string& name, const std::string& where) {
  std::vector<std::string> names;
  for (const RobotType* robot : robot_types()) {
    if (name == robot->name) return *robot;
    names.emplace_back(robot->name);
  }
  throw ConfigError(where + ": robot.type: \"" + name +
                    "\" is no robot of this build; allowed: " + joined(names));
}

std::unique_ptr<const ConfiguredRobot> load_robot(const std::string& path, const Overrides& overrides) {
  return robot_type_of(robot_type(path), path).load(path, overrides);
}

std::string known_estimators() { return per_robot(&RobotType::estimators); }
std::string known_controllers() { return per_robot(&RobotType::controllers); }

void complete(const RobotType& robot, Choice* choice) {
  const auto check = [&](const std::string& what, const std::string& value,
                         const std::vector<std::string>& names) {
    if (std::find(names.begin(), names.end(), value) != names.end()) return;
    throw ConfigError("--" + what + " " + value + ": not known to " + robot.name +
                      "; allowed: " + joined(names));
  };
  if (choice->estimator.empty()) choice->estimator = robot.default_estimator;
  if (choice->controller.empty()) choice->controller = robot.default_controller;
  check("estimator", choice->estimator, robot.estimators);
  check("controller", choice->controller, robot.controllers);
}

runtime::RunInfo run_info(const ConfiguredRobot& robot, const Choice& choice, std::int64_t seed) {
  runtime::RunInfo run;
  run.attitude = choice.attitude;
  run.robot = robot.type->name;
  run.estimator = choice.estimator;
  run.controller = choice.controller;
  run.fidelity = choice.fidelity;
  run.seed = seed;
  run.rolling_radius_m = robot.rolling_radius_m;
  run.version = version();
  run.config_sha256 = robot.sha256;
  run.config_toml = robot.toml;
  return run;
}

}  // namespace equipoise::app
