// Paths to drive: where the robot is to be, and how it is to move, at any time. In: name or file of waypoints
// -> out: position, heading and their rates, continuous; a path begins and ends at rest. Named paths go on
// for ever. W: world frame as at the path's start; yaw about the vertical. Start-up allocates, `at` does not.
#pragma once

#include <memory>
#include <string>

#include "equipoise/types.hpp"

namespace equipoise::app {

struct PathPoint {
  Vec2 position_W_m = Vec2::Zero();
  Vec2 velocity_W_m_s = Vec2::Zero();
  double yaw_rad = 0.0;
  double yaw_rate_rad_s = 0.0;
};

struct PathLimits {
  double speed_m_s = 0.6;  // beyond it the robot is a danger to people
  double acceleration_m_s2 = 0.5;
  double yaw_rate_rad_s = 6.0 * kPi;
  bool along_nose = false;  // for a robot that cannot go sideways
};

class Path {
 public:
  virtual ~Path() = default;
  /// `t_s` from the path's start.
  virtual PathPoint at(double t_s) const noexcept = 0;
};

/// circle, figure8, square, waltz (a circle while spinning), or a file of waypoints: lines of time, x, y, yaw
/// in s, m, m, rad, from zero, # begins a comment. `speed_m_s`: along a named path. InputError says what is
/// wrong: name, file and line, or what of the path exceeds a limit, where, and by how much.
std::unique_ptr<Path> make_path(const std::string& name_or_file, double speed_m_s, const PathLimits& limits);

/// The same path for a robot that moves along its nose and turns with the path: forward speed in x, turning
/// rate.
PathPoint along_its_nose(const Path& path, double t_s) noexcept;

}  // namespace equipoise::app
