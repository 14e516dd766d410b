// What a foreign table's columns mean, from a TOML file that the user writes: columns, axes, signs, units,
// time, ranges, delays, what drove the motors. In: path -> out: ImportMap; ConfigError names file, line and
// key. Start-up only.
#pragma once

#include <limits>
#include <map>
#include <string>
#include <vector>

#include "app/import/table.hpp"

namespace equipoise::app {

inline constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();

/// A column of the table, times a factor that makes it SI and gives it its sign.
struct SignedColumn {
  std::string name;
  double factor = 1.0;
};

/// Columns of one sensor or of the drive.
struct Channel {
  std::vector<SignedColumn> axes;
  std::string kind;          // of wheels: angle, rate; of the drive: volts, duty, torque
  double quantum = 0.0;      // SI; 0: not known
  double range = 0.0;        // SI; 0: not known
  double delay_s = 0.0;      // how much older a value is than its row; of the drive: how much later it acts
  double low_pass_hz = 0.0;  // first-order filter of the robot's own, which is taken back; 0: none
};

struct Stretch {
  double from_s = 0.0;
  double to_s = 0.0;
};

struct ImportMap {
  std::string robot;  // path of the robot's configuration
  std::map<std::string, std::string>
      source;  // where the table is from: repository, commit, path, licence, sha256
  TableShape table;
  SignedColumn time;          // empty: every row is 1 / rate_hz after the last
  bool time_is_step = false;  // the column holds the time since the last row
  double rate_hz = 0.0;
  double from_s = 0.0;
  double to_s = std::numeric_limits<double>::infinity();
  std::vector<Stretch> balancing;  // empty: the whole table
  Channel gyro, accel;             // the sensor's x, y, z, which R_BS turns into the body's; specific force
  Channel wheels;                  // in the order of the robot's motors, relative to the body
  Channel drive;
  SignedColumn battery;  // empty: battery_V
  double battery_V = kNotGiven;
  Channel tilt;     // the robot's own estimate, about body x, of a ball-bot about y too; empty: none
  Channel current;  // of a motor bench, in the order of its motors
};

ImportMap read_import_map(const std::string& path);
/// Of a robot that logs its tilt in place of gyro and accelerometer.
ImportMap read_motion_map(const std::string& path);
/// Of a motor bench: time, wheels (the shafts), drive, current, battery; no robot.
ImportMap read_bench_map(const std::string& path);

}  // namespace equipoise::app
