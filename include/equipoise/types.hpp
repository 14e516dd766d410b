// Scalar, vector and matrix names used everywhere, and the constants of the tick.
// Conventions (docs/symbols.md): W world, z up; B body; R_WB = Rz(theta_z) Ry(theta_y) Rx(theta_x);
// v_W = R_WB * v_B. Starred quantities are resolved in the yaw frame: v_star = Rz(-theta_z) v_W.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace equipoise {

template <int N>
using Vec = Eigen::Matrix<double, N, 1>;
template <int Rows, int Cols>
using Mat = Eigen::Matrix<double, Rows, Cols>;
using Vec2 = Vec<2>;
using Vec3 = Vec<3>;
using Mat3 = Mat<3, 3>;

inline constexpr double kTickHz = 200.0;         // [T] Table 5.2
inline constexpr double kTickS = 1.0 / kTickHz;  // dt
inline constexpr double kGravity_m_s2 = 9.8;     // [T] Tables 3.2, 5.2
inline constexpr double kPi = 3.14159265358979323846;

/// Rz(angle) of horizontal vectors, and back.
class Turn {
 public:
  explicit Turn(double angle_rad) noexcept : c_(std::cos(angle_rad)), s_(std::sin(angle_rad)) {}
  Vec2 operator()(const Vec2& v) const noexcept { return {c_ * v.x() - s_ * v.y(), s_ * v.x() + c_ * v.y()}; }
  Vec2 back(const Vec2& v) const noexcept { return {c_ * v.x() + s_ * v.y(), c_ * v.y() - s_ * v.x()}; }
  /// Of what turns within a tick: to 1e-10 up to 0.2 rad, by series.
  static Turn small(double angle_rad) noexcept {
    const double a2 = angle_rad * angle_rad;
    return {1.0 - a2 * (0.5 - a2 * (1.0 / 24.0 - a2 * (1.0 / 720.0))),
            angle_rad * (1.0 - a2 * (1.0 / 6.0 - a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0))))};
  }
  /// `angle`, when this one turns by little: exact to the last digit or so up to 0.03 rad, else anew.
  Turn near(double angle_rad, double by_rad) const noexcept {
    return std::abs(by_rad) < 0.03 ? *this * small(by_rad) : Turn(angle_rad);
  }
  /// This one and then the other.
  Turn operator*(const Turn& then) const noexcept {
    return {c_ * then.c_ - s_ * then.s_, s_ * then.c_ + c_ * then.s_};
  }
  double cosine() const noexcept { return c_; }
  double sine() const noexcept { return s_; }

 private:
  Turn(double c, double s) noexcept : c_(c), s_(s) {}

  double c_, s_;
};

inline Vec2 rotate(double angle_rad, const Vec2& v) noexcept { return Turn(angle_rad)(v); }

}  // namespace equipoise
