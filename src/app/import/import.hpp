// A foreign table as a log of ours. In: table, map -> out: rows in SI and sensor axes; ticks of 5 ms, each
// with the newest sample, its time and what drove the motors until the next. Counts are whole, as the robot's
// configuration scales them. InputError and ConfigError name what is wrong. Not RT-safe.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/import/import_map.hpp"
#include "equipoise/actuate/bridge.hpp"
#include "equipoise/plant/motor_bench.hpp"
#include "equipoise/runtime/record.hpp"
#include "equipoise/sense/calibrate.hpp"

namespace equipoise::app {

using WheelValues = std::array<double, kMaxMotors>;

/// What an import asks of a robot's configuration.
struct ImportedRobot {
  int wheels = 0;
  Calibration calibration;
  MotorParameters motor;
  double rolling_radius_m = 0.0;
  double imu_height_m = 0.0;                                       // above the axis of rolling
  std::function<std::array<double, 3>(const WheelValues&)> input;  // drive of the wheels -> about the axes
  std::function<Vec2(const WheelValues&)> rolling;                 // wheel rates -> about body x and y
  std::function<double(const WheelValues&)> yaw;  // wheel rates -> of the body; empty: the wheels do not tell
  runtime::RunInfo run;
};

/// Of the configuration at `path`.
ImportedRobot imported_robot(const std::string& path);

/// The table's rows, SI, the IMU's axes.
struct ImportedRows {
  std::vector<double> t_s;
  std::vector<Vec3> gyro_rad_s, accel_m_s2;   // accelerometer: specific force
  std::vector<WheelValues> wheel_rad, drive;  // drive: voltage, share of nominal
  std::vector<double> battery_V;
  std::vector<Vec2> tilt_rad;     // NaN where the table has none
  std::size_t not_advancing = 0;  // rows left out: their time is not after the last
};

ImportedRows imported_rows(const Table& table, const ImportMap& map, const ImportedRobot& robot);
/// One motor of a bench; rows whose time does not advance are left out.
std::vector<BenchSample> imported_bench(const Table& table, const ImportMap& map, std::size_t motor);
std::vector<runtime::TickRecord> imported_ticks(const ImportedRows& rows, const ImportMap& map,
                                                const ImportedRobot& robot);

}  // namespace equipoise::app
