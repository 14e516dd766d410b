// A calibration file: what equipoise calibrate found, per kind with its date and the chip's temperature, in
// sensor axes so that it outlives a turned board. A board file names it: [board] calibration = "FILE".
// In: path -> out: values, or what of them replaces a configuration's; ConfigError names file and key.
// Start-up only.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "equipoise/overrides.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

struct CalibrationFile {
  struct Stamp {
    std::string date;                        // UTC, ISO 8601
    std::optional<double> temperature_degC;  // of the IMU
  };
  struct Gyro {
    Stamp stamp;
    Vec3 bias_rad_s, sigma_rad_s;
  };
  struct Accel {
    Stamp stamp;
    Vec3 scale, bias_m_s2;
    double check_error_m_s2 = 0.0;
  };
  struct Mount {
    Stamp stamp;
    Mat3 R_BS;
  };
  struct Motors {  // what was seen, from 1; the board file holds the wiring
    Stamp stamp;
    std::vector<int> wheel_of_motor, encoder_of_motor;
    std::vector<double> drive;  // of the stall torque, that moved them
  };
  struct Encoders {
    Stamp stamp;
    std::vector<double> counts_per_rev;
  };

  std::string robot;
  int wheel_count = 0;
  std::optional<Gyro> gyro;
  std::optional<Accel> accel;
  std::optional<Mount> mount;
  std::optional<Motors> motors;
  std::optional<Encoders> encoders;
};

/// ConfigError when it is for another robot, of another version, or not understood.
CalibrationFile load_calibration(const std::string& path, const std::string& robot);
CalibrationFile parse_calibration(const std::string& text, const std::string& origin);
std::string to_toml(const CalibrationFile& file);

/// For a robot whose board file says R_BS (rows); the file's own mount has precedence.
MeasuredCalibration measured_of(const CalibrationFile& file, const std::array<double, 9>& R_BS);

/// Now, and the temperature where the IMU tells it (not 0).
CalibrationFile::Stamp stamp_of(double temperature_degC);

/// Whole or not at all: through a temporary file beside it; InputError when it cannot be written.
void write_whole(const std::string& text, const std::string& path);

}  // namespace equipoise::app
