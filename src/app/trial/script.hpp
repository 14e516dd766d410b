// What is asked of a robot that nobody steers: arm, balance in place, then drive and turn steadily or along a
// path. In: the wish, time -> out: command.
#pragma once

#include <memory>

#include "app/trial/firmware.hpp"
#include "app/trial/path.hpp"
#include "equipoise/samples.hpp"

namespace equipoise::app {

/// When the motors are requested, and when the drive starts; between the two the robot balances in place.
inline constexpr double kArmAt_s = 0.5;
inline constexpr double kDriveFrom_s = 1.0;

inline constexpr const char* kPathHelp =
    "circle, figure8, square, waltz (at --drive-mps, default 0.1), or a file of waypoints: time, x, y, yaw "
    "in "
    "s, m, m, rad";

struct Script {
  bool arm = true;
  double drive_mps = 0.0;
  double yaw_rate_rad_s = 0.0;
  std::shared_ptr<const Path> path{};  // in place of the two above
  bool along_nose = false;             // for a robot that cannot go sideways

  Command at(double t_s) const noexcept {
    Command c;
    c.arm = arm && t_s >= kArmAt_s;
    if (t_s < kDriveFrom_s) return c;
    c.velocity_W_m_s = Vec2(drive_mps, 0.0);
    c.yaw_rate_rad_s = yaw_rate_rad_s;
    if (path != nullptr) {
      const double since_s = t_s - kDriveFrom_s;
      const PathPoint point = along_nose ? along_its_nose(*path, since_s) : path->at(since_s);
      c.velocity_W_m_s = point.velocity_W_m_s;
      c.yaw_rate_rad_s = point.yaw_rate_rad_s;
    }
    return c;
  }
};

/// `name`: of --path, or empty.
Script script_for(const ConfiguredRobot& robot, double drive_mps, double yaw_rate_rad_s,
                  const std::string& name);

}  // namespace equipoise::app
