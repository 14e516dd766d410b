// Scalar, vector and matrix names used everywhere, and the constants of the tick.
// Conventions (docs/symbols.md): W world, z up; B body; R_WB = Rz(theta_z) Ry(theta_y) Rx(theta_x);
// v_W = R_WB * v_B. Starred quantities are resolved in the yaw frame: v_star = Rz(-theta_z) v_W.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "equipoise/real.hpp"

namespace equipoise {

template <class Real, int N>
using VecOf = Eigen::Matrix<Real, N, 1>;
template <class Real, int Rows, int Cols>
using MatOf = Eigen::Matrix<Real, Rows, Cols>;
template <int N>
using Vec = VecOf<double, N>;
template <int Rows, int Cols>
using Mat = MatOf<double, Rows, Cols>;
using Vec2 = Vec<2>;
using Vec3 = Vec<3>;
using Mat3 = Mat<3, 3>;

inline constexpr double kTickHz = 200.0;         // [T] Table 5.2
inline constexpr double kTickS = 1.0 / kTickHz;  // dt
inline constexpr double kGravity_m_s2 = 9.8;     // [T] Tables 3.2, 5.2
inline constexpr double kPi = 3.14159265358979323846;

/// Rz(angle) of horizontal vectors, and back.
template <class Real>
class TurnOf {
 public:
  using V = VecOf<Real, 2>;

  explicit TurnOf(const Real& angle_rad) noexcept : c_(cosine_of(angle_rad)), s_(sine_of(angle_rad)) {}
  V operator()(const V& v) const noexcept { return {c_ * v.x() - s_ * v.y(), s_ * v.x() + c_ * v.y()}; }
  V back(const V& v) const noexcept { return {c_ * v.x() + s_ * v.y(), c_ * v.y() - s_ * v.x()}; }
  /// Of what turns within a tick: to 1e-10 up to 0.2 rad, by series.
  static TurnOf small(const Real& angle_rad) noexcept {
    const Real a2 = angle_rad * angle_rad;
    return {1.0 - a2 * (0.5 - a2 * (1.0 / 24.0 - a2 * (1.0 / 720.0))),
            angle_rad * (1.0 - a2 * (1.0 / 6.0 - a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0))))};
  }
  /// `angle`, when this one turns by little: exact to the last digit or so up to 0.03 rad, else anew.
  TurnOf near(const Real& angle_rad, const Real& by) const noexcept {
    using std::abs;
    const auto little = abs(by) < 0.03;
    if (all(little)) return *this * small(by);
    const TurnOf anew(angle_rad);
    const TurnOf then = *this * small(by);
    return {select(little, then.c_, anew.c_), select(little, then.s_, anew.s_)};
  }
  /// This one and then the other.
  TurnOf operator*(const TurnOf& then) const noexcept {
    return {c_ * then.c_ - s_ * then.s_, s_ * then.c_ + c_ * then.s_};
  }
  const Real& cosine() const noexcept { return c_; }
  const Real& sine() const noexcept { return s_; }

 private:
  TurnOf(const Real& c, const Real& s) noexcept : c_(c), s_(s) {}

  static Real cosine_of(const Real& angle_rad) noexcept {
    using std::cos;
    return cos(angle_rad);
  }
  static Real sine_of(const Real& angle_rad) noexcept {
    using std::sin;
    return sin(angle_rad);
  }

  Real c_, s_;
};
using Turn = TurnOf<double>;

inline Vec2 rotate(double angle_rad, const Vec2& v) noexcept { return Turn(angle_rad)(v); }

}  // namespace equipoise
