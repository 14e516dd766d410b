// Counts to SI, sensor axes to body axes. In: RawSample -> out: Measurement (wheel rates still zero).
// The accelerometer's sign changes here and only here: chips report specific force, the models use
// gravity minus acceleration, [T] (5.26). Stateless, RT-safe.
#pragma once

#include "equipoise/samples.hpp"

namespace equipoise {

struct Calibration {
  double gyro_rad_s_per_count = kPi / 180.0 / 16.4;      // MPU-9250 at +-2000 deg/s
  double accel_m_s2_per_count = kGravity_m_s2 / 4096.0;  // MPU-9250 at +-8 g
  double battery_V_per_count = 1.8 / 4095.0 * 11.0;      // Robotics Cape divider on AIN6
  double battery_offset_V = -0.10;
  double encoder_counts_per_rev = 720.0;  // 15 slits x 4 edges x 12:1
  std::array<double, kMaxMotors> encoder_sign{1, 1, 1, 1};
  std::array<double, kMaxMotors> motor_sign{1, 1, 1, 1};
  Mat3 R_BS = Mat3::Identity();  // sensor axes to body axes
  Vec3 gyro_bias_B_rad_s = Vec3::Zero();
  Vec3 accel_scale_S = Vec3::Ones();      // of each sensor axis, beside accel_m_s2_per_count
  Vec3 accel_bias_B_m_s2 = Vec3::Zero();  // of the specific force, after the scale
};

/// Of the sensor's axis that lies along each of the body's, or nearest: 1, or -1 where it points backwards.
inline Vec3 axis_sign(const Mat3& R_BS) noexcept {
  Vec3 sign;
  for (int i = 0; i < 3; ++i) {
    Eigen::Index nearest = 0;
    R_BS.row(i).cwiseAbs().maxCoeff(&nearest);
    sign(i) = R_BS(i, nearest) < 0.0 ? -1.0 : 1.0;
  }
  return sign;
}

/// Roll, pitch, yaw of R = Rz Ry Rx.
inline Vec3 euler_angles(const Mat3& R_WB) noexcept {
  return {std::atan2(R_WB(2, 1), R_WB(2, 2)), std::asin(std::fmax(-1.0, std::fmin(1.0, -R_WB(2, 0)))),
          std::atan2(R_WB(1, 0), R_WB(0, 0))};
}

/// Rotation matrix of a quaternion (w, x, y, z), normalised; NaN from a zero quaternion.
template <class Wxyz>
Mat3 rotation(const Wxyz& wxyz) noexcept {
  const double norm =
      std::sqrt(wxyz[0] * wxyz[0] + wxyz[1] * wxyz[1] + wxyz[2] * wxyz[2] + wxyz[3] * wxyz[3]);
  const double w = wxyz[0] / norm;
  const double x = wxyz[1] / norm;
  const double y = wxyz[2] / norm;
  const double z = wxyz[3] / norm;
  Mat3 R;
  R << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),   //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return R;
}

/// Without `attitude` its angles stay zero: a quarter of the work, for the few estimators that read them.
template <int Wheels>
Measurement<Wheels> calibrate(const RawSample& raw, const Calibration& c, bool attitude = true) noexcept {
  Measurement<Wheels> z;
  z.t_ns = raw.t_ns;
  const Vec3 gyro_S(raw.gyro_counts[0], raw.gyro_counts[1], raw.gyro_counts[2]);
  const Vec3 accel_S(raw.accel_counts[0], raw.accel_counts[1], raw.accel_counts[2]);
  z.gyro_B_rad_s = c.R_BS * (c.gyro_rad_s_per_count * gyro_S) - c.gyro_bias_B_rad_s;
  z.accel_B_m_s2 =
      -(c.R_BS * (c.accel_m_s2_per_count * c.accel_scale_S.cwiseProduct(accel_S)) - c.accel_bias_B_m_s2);
  const double rad_per_count = 2.0 * kPi / c.encoder_counts_per_rev;
  for (int i = 0; i < Wheels; ++i) {
    const auto k = static_cast<std::size_t>(i);
    z.wheel_angle_rad(i) = c.encoder_sign[k] * rad_per_count * raw.encoder_counts[k];
  }
  z.battery_V = c.battery_V_per_count * raw.battery_counts + c.battery_offset_V;
  if (attitude) z.attitude_rad = euler_angles(rotation(raw.attitude_wxyz) * c.R_BS.transpose());
  z.imu_ok = imu_ok(raw);
  z.encoders_ok = encoders_ok(raw);
  z.battery_ok = battery_ok(raw);
  z.attitude_ok = attitude_ok(raw);
  return z;
}

}  // namespace equipoise
