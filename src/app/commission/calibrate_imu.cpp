#include "app/commission/calibrate_imu.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "app/text/format.hpp"

namespace equipoise::app {

const std::array<const char*, 6> kFaceNames{"+x", "+y", "+z", "-x", "-y", "-z"};

namespace {

// An MPU-9250 at 92 Hz has 0.1 deg/s of noise (data sheet: 0.01 deg/s/sqrt(Hz)); a hand shakes several.
constexpr double kStillSigma_rad_s = 0.4 * kPi / 180.0;
constexpr double kStillDrift_rad_s = 0.1 * kPi / 180.0;
constexpr double kMaxBias_rad_s = 25.0 * kPi / 180.0;  // data sheet: 5 deg/s, and 20 over temperature
constexpr double kMaxAccelBias_m_s2 = 2.0;
constexpr double kMaxScaleError = 0.1;

}  // namespace

GyroBias gyro_bias(const Stillness& still, const Calibration& scale) {
  const double k = scale.gyro_rad_s_per_count;
  const double degrees = 180.0 / kPi;
  const double sigma = k * still.gyro_sigma.maxCoeff();
  const double drift = k * still.gyro_drift.cwiseAbs().maxCoeff();
  if (sigma > kStillSigma_rad_s || drift > kStillDrift_rad_s) {
    throw JobError(
        format("the robot moved: %.2f deg/s of shaking (allowed %.2f), %.2f deg/s of change "
               "(allowed %.2f); put it down and do not touch it",
               sigma * degrees, kStillSigma_rad_s * degrees, drift * degrees, kStillDrift_rad_s * degrees));
  }
  for (std::size_t i = 0; i < kMaxMotors; ++i) {
    if (still.encoder_travel[i] > 1.0)
      throw JobError(format("wheel %d turned by %.0f counts; do not touch the robot", static_cast<int>(i) + 1,
                            still.encoder_travel[i]));
  }
  GyroBias bias{k * still.gyro, k * still.gyro_sigma};
  const double largest = bias.bias_S_rad_s.cwiseAbs().maxCoeff();
  if (largest > kMaxBias_rad_s) {
    throw JobError(
        format("%.1f deg/s at rest is no bias (allowed %.0f): it turned evenly, or the chip is broken",
               largest * degrees, kMaxBias_rad_s * degrees));
  }
  return bias;
}

int face_up(const Vec3& accel_S) {
  Eigen::Index axis = 0;
  const double most = accel_S.cwiseAbs().maxCoeff(&axis);
  if (most < std::cos(25.0 * kPi / 180.0) * accel_S.norm()) return -1;
  return static_cast<int>(axis) + (accel_S(axis) > 0.0 ? 0 : 3);
}

AccelFit fit_six_faces(const std::vector<Vec3>& accel, const Vec3& check) {
  std::array<bool, 6> seen{};
  for (const Vec3& a : accel) {
    const int face = face_up(a);
    if (face >= 0) seen[static_cast<std::size_t>(face)] = true;
  }
  std::string missing;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) missing += std::string(missing.empty() ? "" : ", ") + kFaceNames[i];
  }
  if (!missing.empty()) throw JobError("these faces were never up: " + missing + "; nothing was written");

  AccelFit fit;
  const auto rows = static_cast<Eigen::Index>(accel.size());
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::MatrixXd J(rows, 6);
    Eigen::VectorXd residual(rows);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const Vec3& a = accel[static_cast<std::size_t>(i)];
      const Vec3 corrected = fit.scale_S.cwiseProduct(a) - fit.bias_S_m_s2;
      const Vec3 direction = corrected.normalized();
      J.block<1, 3>(i, 0) = direction.cwiseProduct(a).transpose();
      J.block<1, 3>(i, 3) = -direction.transpose();
      residual(i) = corrected.norm() - kGravity_m_s2;
    }
    const Eigen::VectorXd step = J.colPivHouseholderQr().solve(-residual);
    fit.scale_S += step.head<3>();
    fit.bias_S_m_s2 += step.tail<3>();
  }
  fit.check_error_m_s2 = std::abs((fit.scale_S.cwiseProduct(check) - fit.bias_S_m_s2).norm() - kGravity_m_s2);
  const double scale_error = (fit.scale_S - Vec3::Ones()).cwiseAbs().maxCoeff();
  const double bias = fit.bias_S_m_s2.cwiseAbs().maxCoeff();
  if (!(scale_error < kMaxScaleError) || !(bias < kMaxAccelBias_m_s2)) {
    throw JobError(
        format("implausible fit (scale off by %.0f %%, bias %.2f m/s2): was the robot still on every face?",
               100.0 * scale_error, bias));
  }
  return fit;
}

Mat3 mount_rotation(const Vec3& upright_S, const Vec3& tipped_S, const Vec3& axis_B) {
  for (const Vec3& a : {upright_S, tipped_S}) {
    if (std::abs(a.norm() - kGravity_m_s2) > 0.1 * kGravity_m_s2)
      throw JobError(
          format("%.1f m/s2 at rest is not gravity: calibrate accel first, or hold still", a.norm()));
  }
  const Vec3 up = upright_S.normalized();  // body z in sensor axes: specific force at rest points up
  const double tilt = std::acos(std::clamp(up.dot(tipped_S.normalized()), -1.0, 1.0));
  if (tilt < 15.0 * kPi / 180.0 || tilt > 120.0 * kPi / 180.0) {
    throw JobError(format("tipped by %.0f degrees where 15 to 120 are needed", tilt * 180.0 / kPi));
  }
  // Turning the body by +a about an axis turns gravity by -a about it as the sensor sees it.
  const Vec3 axis_S = tipped_S.cross(up).normalized();
  Mat3 body;    // two directions and their product, body axes
  Mat3 sensor;  // the same, sensor axes
  body << axis_B, Vec3::UnitZ(), axis_B.cross(Vec3::UnitZ());
  sensor << axis_S, up, axis_S.cross(up);
  return body * sensor.transpose();
}

}  // namespace equipoise::app
