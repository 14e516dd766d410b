// Bias of the gyro, bias and scale of the accelerometer, rotation of the board in the body.
// In: samples at rest -> out: what a calibration file keeps, in sensor axes so that it outlives a turned
// board. JobError when the robot moved, a face is missing or the answer is implausible: never a bad value.
#pragma once

#include <array>

#include "app/commission/manual_drive.hpp"
#include "equipoise/sense/calibrate.hpp"

namespace equipoise::app {

struct GyroBias {
  Vec3 bias_S_rad_s = Vec3::Zero();
  Vec3 sigma_S_rad_s = Vec3::Zero();  // of single samples
};

/// JobError says how much it moved.
GyroBias gyro_bias(const Stillness& still, const Calibration& scale);

struct AccelFit {
  Vec3 scale_S = Vec3::Ones();
  Vec3 bias_S_m_s2 = Vec3::Zero();  // true = scale * nominal - bias
  double check_error_m_s2 = 0.0;    // | |a| - g | in a pose that the fit has not seen
};

/// 0 .. 5: +x, +y, +z, -x, -y, -z of the sensor points up; -1: none within 25 degrees.
int face_up(const Vec3& accel_S);
extern const std::array<const char*, 6> kFaceNames;

/// Six poses, one per face (any order), nominal m/s2: Gauss-Newton on |scale a - bias| = g.
AccelFit fit_six_faces(const std::vector<Vec3>& accel_S_m_s2, const Vec3& check_S_m_s2);

/// Body axes from gravity at two poses: upright, then tipped about `axis_B` (x or y) by 15 to 120 degrees.
Mat3 mount_rotation(const Vec3& upright_S, const Vec3& tipped_S, const Vec3& axis_B);

}  // namespace equipoise::app
