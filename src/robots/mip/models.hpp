// Models of the MIP's smaller filters, for KalmanFilter: planar, and the inclinometer with gyro bias.
// Coefficients come from the derivation (config/generated/mip_model.hpp).
// Source: [T] (3.1), (3.30), (3.32), (3.35)-(3.47); corrections in docs/derivation.md. RT-safe.
#pragma once

#include "generated/mip_model.hpp"
#include "robots/mip/mip.hpp"

namespace equipoise {

using MipCoefficients = generated::mip::Coefficients<double>;

/// `l_ay`, `l_az`: where the filter believes the IMU to be, from the axle.
MipCoefficients mip_coefficients(const MipParameters& p, double l_ay, double l_az) noexcept;

/// theta, phi, theta', phi'; input u_x; measurements phi, gyro x, accelerometer y. (3.32)
class MipPlanarModel {
 public:
  static constexpr int kStates = 4;
  static constexpr int kInputs = 1;
  static constexpr int kOutputs = 3;

  explicit MipPlanarModel(const MipParameters& p) noexcept : c_(mip_coefficients(p, 0.0, p.l)) {}
  void predict(const Vec<4>& x, const Vec<1>& u, Vec<4>& x_next, Mat<4, 4>& F) const noexcept;
  Mat<4, 1> input_matrix() const noexcept;
  void measure(const Vec<4>& x, const Vec<1>& u, Vec<3>& y, Mat<3, 4>& H) const noexcept;

 private:
  MipCoefficients c_;
};

/// theta and gyro bias; input gyro x; measurement the accelerometer's inclination. (3.1)
struct MipInclinometerModel {
  static constexpr int kStates = 2;
  static constexpr int kInputs = 1;
  static constexpr int kOutputs = 1;
  void predict(const Vec<2>& x, const Vec<1>& gyro, Vec<2>& x_next, Mat<2, 2>& F) const noexcept;
  Mat<2, 1> input_matrix() const noexcept { return {kTickS, 0.0}; }
  void measure(const Vec<2>& x, const Vec<1>& gyro, Vec<1>& y, Mat<1, 2>& H) const noexcept;
};

/// Inclination that the accelerometer shows at rest. (3.28)
inline double accel_inclination(const Vec3& accel_B_m_s2) noexcept {
  return std::atan2(-accel_B_m_s2.y(), -accel_B_m_s2.z());
}

}  // namespace equipoise
