#include "equipoise/actuate/drive_coast.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise {
namespace {

// With w = sign(u) omega_r: b = (1 + w)/2, d = (1 - w)/2. In s with 1 + b s = exp(v T_r), (4.30) reads
// (i_avg/i_s) T_r/2 = log1p(b s) - b log1p(s), which has no cancellation left but at small s (series below).

/// Duty above which the current never reaches zero, [T] (4.27).
double boundary_duty(double T_r, double b, double d) noexcept {
  return T_r > 0.0 ? 1.0 + std::log1p(d * std::expm1(-T_r)) / T_r : b;
}

/// (log1p(b s) - b log1p(s)) / (b d) as a function of t = log1p(s).
double scaled_current(double t, double b, double d) noexcept {
  constexpr double kSeriesBelow = 0.02;  // nine terms leave 1e-17 relative
  if (t < kSeriesBelow) {
    const double s = std::expm1(t);
    double sum = 0.0;
    double geometric = 0.0;  // (1 - b^(n-1)) / (1 - b)
    double b_power = 1.0;
    double s_power = s;
    double sign = 1.0;
    for (int n = 2; n <= 10; ++n) {
      geometric += b_power;
      b_power *= b;
      s_power *= s;
      sum += sign * s_power * geometric / n;
      sign = -sign;
    }
    return sum;
  }
  if (b < 0.5) return (std::log1p(b * std::expm1(t)) - b * t) / (b * d);
  return (t + std::log1p(d * std::expm1(-t)) / d) / b;
}

/// Solves scaled_current(t) = target; returns v T_r.
double solve_exponent(double target, double b, double d, double exponent_max, int* iterations) noexcept {
  const double bound =
      b * target - b * std::log(b) / d;  // v T_r if the current decayed completely, from above
  constexpr double kDecayed = 45.0;      // exp(-45) is below one ulp
  if (bound > kDecayed && b * target > kDecayed) return bound;

  constexpr double kSeriesStartBelow = 1.2;
  const double r = std::sqrt(2.0 * target);
  double t = 0.0;
  if (r < kSeriesStartBelow) {  // inverse of the series above, four terms
    const double r2 = r * r;
    t = std::log1p(r + (1.0 + b) * r2 / 3.0 + (b * b + 11.0 * b + 1.0) * r2 * r / 36.0 -
                   (1.0 + b) * (b * b - 25.0 * b + 1.0) * r2 * r2 / 270.0);
  } else {  // two steps of x <- K + b log1p(expm1(x)/b), which falls monotonically onto the root
    double x = std::min(bound, exponent_max);
    for (int i = 0; i < 2; ++i) x = b * d * target + b * std::log1p(std::expm1(x) / b);
    t = std::log1p(std::expm1(x) / b);
  }

  // Halley: the function is convex and increasing in t.
  constexpr double kStepDone = 1e-4;  // cubic convergence: the next step would be near 1e-12
  for (*iterations = 0; *iterations < kDriveCoastMaxIterations;) {
    const double y = -std::expm1(-t);
    const double q = std::exp(-t) + b * y;
    const double slope = y / q;
    const double curvature = (1.0 - y) / (q * q);
    const double residual = scaled_current(t, b, d) - target;
    const double denominator = slope - 0.5 * residual * curvature / slope;
    const double step = residual / (denominator > 0.0 ? denominator : slope);
    t = std::max(t - step, 0.5 * t);
    ++*iterations;
    if (std::abs(step) < kStepDone * t) break;
  }
  return std::log1p(b * std::expm1(t));
}

}  // namespace

DriveCoastCommand::DriveCoastCommand(double T_r, double u) noexcept
    : T_r_(T_r),
      sign_(u < 0.0 ? -1.0 : 1.0),
      v_(std::min(std::abs(u), 1.0)),
      drained_(-std::expm1(-v_ * T_r)),
      off_decay_(-std::expm1(-(1.0 - v_) * T_r)),
      full_decay_(-std::expm1(-T_r)) {}

double DriveCoastCommand::mean_current(double omega_r) const noexcept {
  if (v_ == 0.0) return 0.0;  // (4.28)
  const double w = std::clamp(sign_ * omega_r, -1.0, 1.0);
  const double b = 0.5 * (1.0 + w);
  const double d = 0.5 * (1.0 - w);
  // (4.27) without its logarithm: v > boundary where exp(-(1 - v) T_r) > b + d exp(-T_r)
  const bool continuous = b == 0.0 || (T_r_ > 0.0 ? off_decay_ < d * full_decay_ : v_ > b);
  if (continuous) return sign_ * (2.0 * v_ - 1.0 - w);                      // (4.29)
  if (T_r_ <= 0.0) return 0.0;                                              // (4.30), T_r -> 0
  return sign_ * 2.0 * (v_ * d - b / T_r_ * std::log1p(d / b * drained_));  // (4.30)
}

double drive_coast_mean_current(double T_r, double omega_r, double u) noexcept {
  return DriveCoastCommand(T_r, u).mean_current(omega_r);
}

DriveCoastSolution drive_coast_invert(double T_r, double omega_r, double i_over_is) noexcept {
  if (i_over_is == 0.0) return {};
  const double sign = i_over_is < 0.0 ? -1.0 : 1.0;
  const double g = std::abs(i_over_is);
  const double w = std::clamp(sign * omega_r, -1.0, 1.0);
  const double b = 0.5 * (1.0 + w);
  const double d = 0.5 * (1.0 - w);
  const double v_continuous = 0.5 * (g + 1.0 + w);  // (4.29)
  if (!(v_continuous < boundary_duty(T_r, b, d))) {
    if (v_continuous > 1.0) return {sign, 0, false};
    return {sign * v_continuous, 0, true};
  }
  DriveCoastSolution solution;
  const double target = g * T_r / (2.0 * b * d);
  solution.u = sign * std::min(solve_exponent(target, b, d, T_r, &solution.iterations) / T_r, 1.0);
  return solution;
}

}  // namespace equipoise
