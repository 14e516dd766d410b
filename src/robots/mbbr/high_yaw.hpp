// The corrected high-yaw-rate model of the MBBR, in the 13 printed states and in its 10 observable ones.
// Accelerations and accelerometer rows come from the derivation script (config/generated/mbbr_model.hpp);
// this file adds the kinematics, the encoder rows, [T] (5.31)-(5.33), and the transport term of the turning
// frame that [T] lacks. f and h see phi*, theta_z and x11..x13 only through phi_x* + x11, phi_y* + x12 and
// x13 - theta_z, so three of the 13 states are unobservable; the 10 observable ones keep just these sums.
// RT-safe.
#pragma once

#include "generated/mbbr_model.hpp"
#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

using MbbrCoefficients = generated::mbbr::Coefficients<double>;
MbbrCoefficients mbbr_coefficients(const MbbrParameters& p) noexcept;

/// What both forms share: accelerations with transport, gyro and accelerometer rows, and their Jacobians in
/// the seven dynamic variables (theta_x, theta_y, theta_x', theta_y', theta_z', phi_x*', phi_y*').
struct MbbrHighYaw {
  using State = Vec<7>;
  enum Index : int { kThetaX, kThetaY, kThetaDotX, kThetaDotY, kThetaDotZ, kPhiDotX, kPhiDotY };

  static void accelerations(const MbbrCoefficients& c, const State& x, const Vec3& u, Vec<5>& a,
                            Mat<5, 7>& J) noexcept;
  /// Accelerations per unit of u, in which they are affine.
  static Mat<5, 3> input_matrix(const MbbrCoefficients& c, const State& x, const Vec3& u) noexcept;
  /// Body rates as the gyro's rows have them, to the first order in the tilt.
  static Vec3 body_rates(const Vec2& theta_xy, const Vec3& theta_dot) noexcept {
    return {theta_dot.x() - theta_xy.y() * theta_dot.z(), theta_dot.y() + theta_xy.x() * theta_dot.z(),
            theta_dot.z() - theta_xy.x() * theta_dot.y()};
  }
  static void inertial_rows(const MbbrCoefficients& c, const State& x, const Vec3& u, Vec<5>& y,
                            Mat<5, 7>& J) noexcept;  // gyro x, y, z, accelerometer x, y
};

/// The observable states: theta_x, theta_y, e_x, e_y, e_z, theta_x', theta_y', theta_z', phi_x*', phi_y*';
/// e_x = phi_x* + x11, e_y = phi_y* + x12, e_z = x13 - theta_z.
struct MbbrObservable {
  using State = Vec<10>;
  enum Index : int { kThetaX, kThetaY, kE, kThetaDotX = 5, kThetaDotY, kThetaDotZ, kPhiDotX, kPhiDotY };

  static MbbrHighYaw::State dynamic(const State& x) noexcept {
    MbbrHighYaw::State d;
    d.head<2>() = x.head<2>();
    d.tail<5>() = x.tail<5>();
    return d;
  }
  /// dx/dt.
  static State rate(const MbbrCoefficients& c, const State& x, const Vec3& u) noexcept;
  /// dx/dt and its Jacobian.
  static void derivative(const MbbrCoefficients& c, const State& x, const Vec3& u, State& x_dot,
                         Mat<10, 10>& A) noexcept;
  /// Rate of the ball against the body, body axes, as the encoders see it.
  static Vec3 encoder_rate_B(const State& x) noexcept;
};

/// States as printed, [T] (5.30).
class MbbrModel13 {
 public:
  static constexpr int kStates = 13;
  static constexpr int kInputs = 3;
  static constexpr int kOutputs = 8;

  explicit MbbrModel13(const MbbrParameters& p) : c_(mbbr_coefficients(p)) {}
  void predict(const Vec<13>& x, const Vec3& u, Vec<13>& x_next, Mat<13, 13>& F) const noexcept;
  Mat<13, 3> input_matrix() const noexcept;
  void measure(const Vec<13>& x, const Vec3& u, Vec<8>& y, Mat<8, 13>& H) const noexcept;

 private:
  MbbrCoefficients c_;
};

/// Linear model: the same at zero yaw rate, two decoupled pendulums, [T] (5.27)-(5.29) with derived
/// coefficients. With `yaw_transport` the third input is the measured yaw rate, and tilt, encoder sum and
/// ball rates turn with the frame they are resolved in; without it, as in [T], they lag by the spin.
class MbbrLinearModel {
 public:
  static constexpr int kStates = 8;  // theta_x, theta_y, encoder sums x, y, body rates x, y, phi_x*', phi_y*'
  static constexpr int kInputs = 3;  // u_x, u_y, yaw rate
  static constexpr int kOutputs = 6;  // gyro x, y, encoder x, y, accelerometer x, y

  MbbrLinearModel(const MbbrParameters& p, bool yaw_transport) noexcept;
  /// (5.28), (5.29) in their published digits, for comparison only.
  static MbbrLinearModel published() noexcept;
  void predict(const Vec<8>& x, const Vec3& u, Vec<8>& x_next, Mat<8, 8>& F) const noexcept;
  Mat<8, 3> input_matrix() const noexcept { return B_; }
  void measure(const Vec<8>& x, const Vec3& u, Vec<6>& y, Mat<6, 8>& H) const noexcept;

 private:
  Mat<8, 8> F_;
  Mat<8, 3> B_;  // third column zero
  Mat<6, 8> H_;
  Mat<6, 3> D_;
  bool yaw_transport_ = false;

  MbbrLinearModel() = default;
  void discretise(const Mat<8, 8>& A) noexcept { F_ = Mat<8, 8>::Identity() + kTickS * A; }  // (6.1)
};

}  // namespace equipoise
