// What stands above a configuration file, typed: what is known of the board that it runs on, and --set. The
// board's facts must be those of the configuration, what was measured on it replaces the configuration's, and
// --set has the last word. In: board file, calibration file, command line -> out: values for the
// configuration. Start-up only.
#pragma once

#include <array>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace equipoise {

/// What a board file says that the configuration says too: the drivers need one, simulation and control the
/// other.
struct BoardFacts {
  std::string file;
  double pwm_hz = 0.0;
  std::string bridge;          // drive_brake or drive_coast
  std::array<double, 9> R_BS;  // rows
  double gyro_delay_s = 0.0;   // of the IMU's low pass
  double accel_delay_s = 0.0;
  double battery_V_per_count = 0.0;
  double battery_offset_V = 0.0;
};

/// Of this very robot, from its calibration file; absent: as configured.
struct MeasuredCalibration {
  std::optional<std::array<double, 9>> R_BS;  // rows
  std::optional<std::array<double, 3>> gyro_bias_B_rad_s;
  std::optional<std::array<double, 3>> accel_scale_S;
  std::optional<std::array<double, 3>> accel_bias_B_m_s2;
};

struct Overrides {
  Overrides() = default;
  Overrides(std::vector<std::string> texts) : set(std::move(texts)) {}
  Overrides(std::initializer_list<std::string> texts) : set(texts) {}

  std::optional<BoardFacts> board;
  MeasuredCalibration measured;
  std::vector<std::string> set;  // key=value, of --set
};

}  // namespace equipoise
