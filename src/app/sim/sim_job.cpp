#include "app/sim/sim_job.hpp"

#include "app/text/errors.hpp"

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

}  // namespace equipoise::app
