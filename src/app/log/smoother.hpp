// Tilt by the whole log: gravity's direction in body axes and the gyro's bias, which it reads where the robot
// stands, by a Kalman filter forwards and Rauch, Tung and Striebel's pass back. Knows nothing of motors or
// masses, so it judges filters that do.
// In: calibrated samples -> out: tilt and bias per tick. Source: Rauch, Tung, Striebel, AIAA J. 3(8), 1965.
#pragma once

#include <vector>

#include "equipoise/types.hpp"

namespace equipoise::app {

struct SmootherSample {
  Vec3 gyro_rad_s = Vec3::Zero();
  Vec3 accel_m_s2 = Vec3::Zero();   // specific force
  Vec2 rolling_rad = Vec2::Zero();  // of the wheels or the ball against the body, about x and y
  bool imu_ok = false;
};

struct Smoothed {
  std::vector<Vec2> tilt_rad;       // roll, pitch
  std::vector<Vec2> tilt_variance;  // rad^2, of a mount that is known
  std::vector<Vec3> bias_rad_s;
};

/// `radius_m`: of what rolls; `imu_height_m`: above its axis.
Smoothed smooth(const std::vector<SmootherSample>& samples, double radius_m, double imu_height_m);

}  // namespace equipoise::app
