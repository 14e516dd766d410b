// LCM event logs of a bench, channel EQUIPOISE_BENCH. In: samples -> out: file, and back.
// InputError names the file and what is wrong with it. Not RT-safe.
#pragma once

#include <string>
#include <vector>

namespace equipoise::app {

enum class LoggedBridge : int { kUnknown = 0, kDriveBrake = 1, kDriveCoast = 2 };

struct BenchRow {
  double t_s = 0.0;
  double u = 0.0;
  double current_A = 0.0;
  double supply_V = 0.0;
  double angle_rad = 0.0;
};

struct BenchLog {
  LoggedBridge bridge = LoggedBridge::kUnknown;
  int axis = 0;  // 0 motor, 1 ball about x, 2 about y
  std::vector<BenchRow> rows;
};

void write_bench_log(const std::string& path, const BenchLog& log);
BenchLog read_bench_log(const std::string& path);

}  // namespace equipoise::app
