// The MIP's high-yaw-rate model exactly as printed, for comparison only: [T] (3.38)-(3.47). Its known errors
// (docs/derivation.md): 0.009 and -0.016 for 0.0030 and -0.0053 in (3.41)-(3.42); the IMU taken for being at
// the centre of mass. RT-safe.
#pragma once

#include "equipoise/types.hpp"

namespace equipoise {

struct MipPublishedModel {
  static constexpr int kStates = 6;  // theta, phi, psi and their rates
  static constexpr int kInputs = 2;
  static constexpr int kOutputs = 4;  // phi, gyro x, accelerometer y, psi
  enum State : int { kTheta, kPhi, kPsi, kThetaDot, kPhiDot, kPsiDot };

  void predict(const Vec<6>& x, const Vec2& u, Vec<6>& x_next, Mat<6, 6>& F) const noexcept {
    const double theta = x(kTheta);
    const double turn = x(kPsiDot);
    x_next.head<3>() = x.head<3>() + 0.005 * x.tail<3>();
    x_next(kThetaDot) = x(kThetaDot) + 0.629 * theta + 0.068 * x(kPhiDot) + 0.009 * theta * turn * turn -
                        2.72 * u.x();  // (3.41)
    x_next(kPhiDot) = 0.813 * x(kPhiDot) - 1.12 * theta - 0.016 * theta * turn * turn + 7.47 * u.x();
    x_next(kPsiDot) = 0.939 * turn + 2.44 * u.y();
    F.setIdentity();
    F.block<3, 3>(0, 3).diagonal().setConstant(0.005);
    F(kThetaDot, kTheta) = 0.629 + 0.009 * turn * turn;
    F(kThetaDot, kPhiDot) = 0.068;
    F(kThetaDot, kPsiDot) = 2.0 * 0.009 * theta * turn;
    F(kPhiDot, kTheta) = -1.12 - 0.016 * turn * turn;
    F(kPhiDot, kPhiDot) = 0.813;
    F(kPhiDot, kPsiDot) = -2.0 * 0.016 * theta * turn;
    F(kPsiDot, kPsiDot) = 0.939;
  }

  Mat<6, 2> input_matrix() const noexcept { return Mat<6, 2>::Zero(); }  // [T] has diagonal Q only

  void measure(const Vec<6>& x, const Vec2& u, Vec<4>& y, Mat<4, 6>& H) const noexcept {
    const double theta = x(kTheta);
    const double turn = x(kPsiDot);
    const double accel_y =
        8.17 * u.x() - 7.41 * theta - 0.204 * x(kPhiDot) - 0.0346 * theta * turn * turn;  // (3.47)
    y << x(kPhi), x(kThetaDot), accel_y, x(kPsi);
    H.setZero();
    H(0, kPhi) = 1.0;
    H(1, kThetaDot) = 1.0;
    H(2, kTheta) = -7.41 - 0.0346 * turn * turn;
    H(2, kPhiDot) = -0.204;
    H(2, kPsiDot) = -2.0 * 0.0346 * theta * turn;
    H(3, kPsi) = 1.0;
  }
};

}  // namespace equipoise
