// Logs of a bench: LCM event logs, channel EQUIPOISE_BENCH, and to read also CSV with a header
// t_s,u,current_A,supply_V,angle_rad (any order; others are ignored; without a sensor no current_A).
// In: samples -> out: file, and back. InputError names the file and what is wrong with it. Not RT-safe.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "equipoise/plant/motor_bench.hpp"

namespace equipoise::app {

enum class LoggedBridge : int { kUnknown = 0, kDriveBrake = 1, kDriveCoast = 2 };

struct BenchLog {
  LoggedBridge bridge = LoggedBridge::kUnknown;
  int axis = 0;                                                    // 0 motor, 1 ball about x, 2 about y
  double radius_ratio = std::numeric_limits<double>::quiet_NaN();  // flywheel over ball; NaN: nobody said
  std::vector<BenchSample> rows;
};

void write_bench_log(const std::string& path, const BenchLog& log);
/// By its name: .csv, else LCM.
BenchLog read_bench_log(const std::string& path);
/// Another recorder's table, by a map of its columns; `motor` counts from 1.
BenchLog read_bench_table(const std::string& path, const std::string& map, int motor);

}  // namespace equipoise::app
