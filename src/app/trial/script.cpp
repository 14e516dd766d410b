#include "app/trial/script.hpp"

namespace equipoise::app {

Script script_for(const ConfiguredRobot& robot, double drive_mps, double yaw_rate_rad_s,
                  const std::string& name) {
  constexpr double kPathSpeed_m_s = 0.1;
  Script script;
  script.drive_mps = drive_mps;
  script.yaw_rate_rad_s = yaw_rate_rad_s;
  script.along_nose = !robot.type->drives_sideways;
  if (!name.empty()) {
    PathLimits limits;
    limits.acceleration_m_s2 = robot.max_acceleration_m_s2;
    limits.along_nose = script.along_nose;
    script.path = make_path(name, drive_mps != 0.0 ? drive_mps : kPathSpeed_m_s, limits);
  }
  return script;
}

}  // namespace equipoise::app
