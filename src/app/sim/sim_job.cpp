#include "app/sim/sim_job.hpp"

#include "app/text/errors.hpp"
#include "app/text/reasons.hpp"
#include "app/text/version.hpp"

namespace equipoise::app {
namespace {

void check_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;  // not NaN
  const nlohmann::json numbers{value, low, high};
  throw InputError(std::string(name) + ": " + numbers[0].dump() +
                   " is out of range; allowed: " + numbers[1].dump() + " to " + numbers[2].dump());
}

}  // namespace

nlohmann::json by_name(const std::vector<config::Drawn>& drawn) {
  nlohmann::json out = nlohmann::json::object();
  for (const config::Drawn& d : drawn) {
    for (std::size_t i = 0; i < d.values.size(); ++i)
      out[d.values.size() == 1 ? d.key : d.key + "[" + std::to_string(i) + "]"] = d.values[i];
  }
  return out;
}

void check(const SimRequest& r) {
  check_range("yaw_hz", r.yaw_rate_rad_s / (2.0 * kPi), -kMostYaw_hz, kMostYaw_hz);
  check_range("drive_mps", r.drive_mps, -kMostDrive_mps, kMostDrive_mps);
  check_range("duration_s", r.duration_s, kShortest_s, kLongest_s);
  check_range("robot_number", static_cast<double>(r.robot), 0.0, 1e12);
  fidelity_level(r.choice.fidelity);
  if (r.choice.attitude != "dmp" && r.choice.attitude != "own")
    throw InputError("attitude: \"" + r.choice.attitude + "\" is not known; allowed: dmp, own");
  if (!r.path.empty() && r.yaw_rate_rad_s != 0.0)
    throw InputError("path and yaw_hz exclude each other: the path says how the robot turns");
}

std::unique_ptr<const ConfiguredRobot> load_for(SimRequest* request, std::vector<config::Drawn>* drawn) {
  const RobotType& type = robot_type_of(robot_type(request->config), request->config);
  complete(type, &request->choice);
  const std::vector<config::Drawn> robot =
      config::draw_robot(request->config, request->set, request->choice.fidelity, request->robot);
  if (drawn != nullptr) *drawn = robot;
  return type.load(request->config, config::with_robot_drawn(robot, request->choice.fidelity, request->set));
}

SimOptions options_for(const SimRequest& request, const ConfiguredRobot& robot) {
  SimOptions options;
  options.script = script_for(robot, request.drive_mps, request.yaw_rate_rad_s, request.path);
  options.duration_s = request.duration_s;
  options.seed = request.seed;
  if (!request.fault.empty()) options.faults = {planned_fault(request.fault)};
  return options;
}

nlohmann::json figures(const RobotType& robot, const SimSummary& s) {
  nlohmann::json out{{"attitude_rmse_rad", s.controlling.attitude_rmse_rad},
                     {robot.speed_rmse_key, s.controlling.speed_rmse},
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

nlohmann::json to_json(const SimRequest& request, const SimSummary& s, const ConfiguredRobot& robot) {
  nlohmann::json estimators = nlohmann::json::object();
  for (const auto& [name, errors] : s.estimators) {
    estimators[name] = {{"attitude_rmse_rad", errors.attitude_rmse_rad},
                        {robot.type->speed_rmse_key, errors.speed_rmse}};
  }
  nlohmann::json out{{"robot", robot.type->name},
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
                     {"config_sha256", robot.sha256},
                     {"version", version()}};
  out.update(figures(*robot.type, s));
  return out;
}

}  // namespace equipoise::app
