// Mean current of a drive/coast H-bridge in periodic steady state, and its inverse.
// In: T_r = T_pwm R/L, omega_r = omega/omega_nl, u in [-1, 1]  ->  i_avg/i_s; and back.
// Source: [T] (4.27)-(4.36), rewritten with log1p/expm1 so that every edge (T_r -> 0 and infinity,
// omega_r -> +-1, i -> 0) keeps full precision. |omega_r| > 1 is outside the model and clamped.
// RT-safe: bounded iterations, no allocation.
#pragma once

#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {

/// i_avg/i_s for command u. [T] (4.28)-(4.30).
double drive_coast_mean_current(double T_r, double omega_r, double u) noexcept;

/// The same for a command that is held while the speed changes: what depends on the command alone, computed
/// once.
template <class Real>
class DriveCoastCommandOf {
 public:
  DriveCoastCommandOf() = default;
  DriveCoastCommandOf(double T_r, double u) noexcept;
  Real mean_current(const Real& omega_r) const noexcept;

 private:
  Real T_r_{0.0};
  Real sign_{1.0};
  Real v_{0.0};
  Real drained_{0.0};     // 1 - exp(-v T_r)
  Real off_decay_{0.0};   // 1 - exp(-(1 - v) T_r)
  Real full_decay_{0.0};  // 1 - exp(-T_r)
};
using DriveCoastCommand = DriveCoastCommandOf<double>;

template <class Real>
Real DriveCoastCommandOf<Real>::mean_current(const Real& omega_r) const noexcept {
  using std::log1p;
  if (all(v_ == 0.0)) return 0.0;  // (4.28)
  const Real w = limited(sign_ * omega_r, Real(-1.0), Real(1.0));
  const Real b = 0.5 * (1.0 + w);
  const Real d = 0.5 * (1.0 - w);
  const Real flows_on = sign_ * (2.0 * v_ - 1.0 - w);  // (4.29)
  const auto unlimited = b == 0.0;
  if (!all(T_r_ > 0.0)) return select(unlimited || v_ > b, flows_on, Real(0.0));  // (4.30), T_r -> 0
  // (4.27) without its logarithm: v > boundary where exp(-(1 - v) T_r) > b + d exp(-T_r)
  const auto continuous = unlimited || off_decay_ < d * full_decay_;
  if (all(continuous)) return flows_on;
  const Real passes = d / b * drained_;
  const Real stops =
      sign_ * 2.0 * (v_ * d - b / T_r_ * log1p(select(continuous, Real(0.0), passes)));  // (4.30)
  return select(continuous, flows_on, stops);
}

struct DriveCoastSolution {
  double u = 0.0;         // command, -1 .. 1
  int iterations = 0;     // of the scalar solver, at most kDriveCoastMaxIterations
  bool reachable = true;  // false: the target needs |u| > 1, u is clamped to +-1
};
inline constexpr int kDriveCoastMaxIterations = 4;

/// The command whose mean current is `i_over_is`, [T] section 4.4; for one motor, whose T_r does not change.
class DriveCoastInverse {
 public:
  explicit DriveCoastInverse(double T_r) noexcept;
  DriveCoastSolution solve(double omega_r, double i_over_is) const noexcept;

 private:
  double T_r_;
  double full_decay_;  // 1 - exp(-T_r)
};
DriveCoastSolution drive_coast_invert(double T_r, double omega_r, double i_over_is) noexcept;

}  // namespace equipoise
