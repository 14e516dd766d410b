#include "equipoise/actuate/drive_coast.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise {
namespace {

// With w = sign(u) omega_r: b = (1 + w)/2, d = (1 - w)/2. In s with 1 + b s = exp(v T_r), (4.30) reads
// (i_avg/i_s) T_r/2 = log1p(b s) - b log1p(s), which has no cancellation left but at small s (series below).

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

/// s with scaled_current = r^2 / 2, six terms.
inline double inverse_series(double r, double b) noexcept {
  const double p = 1.0 + b;
  const double b2 = b * b;
  const double q = 1.0 + b2;
  const double q2 = q * q + 265.0 * b2;
  const double a3 = (q + 11.0 * b) * (1.0 / 36.0);
  const double a4 = p * (25.0 * b - q) * (1.0 / 270.0);
  const double a5 = (q2 + 22.0 * b * q) * (1.0 / 4320.0);
  const double a6 = p * (q2 - 14.0 * b * q) * (1.0 / 17010.0);
  return r * (1.0 + r * (p * (1.0 / 3.0) + r * (a3 + r * (a4 + r * (a5 + r * a6)))));
}

/// v T_r of scaled_current(t) = target, in s = expm1(t), away from the domain's edges: there nothing cancels.
/// Starts from the inverse series, then Halley, whose derivatives are rational. With |log1p(s)| known, 1 + b
/// s follows from the last step without another logarithm.
double solve_inside(double target, double r, double b, double d, int* iterations) noexcept {
  double s = inverse_series(r, b);
  constexpr double kStepDone = 1e-4;  // of s; cubic convergence: what is left is near 1e-12
  double exponent = 0.0;
  const double scale = b * d;
  for (*iterations = 0; *iterations < 2;) {
    const double bs = b * s;
    const double drained = std::log1p(bs);
    const double residual = drained - b * std::log1p(s) - scale * target;
    // Slope and curvature of the residual: scale s / product and scale (1 - b s^2) / product^2.
    const double product = (1.0 + bs) * (1.0 + s);
    const double slope = scale * s;
    const double step =
        residual * slope * product / (slope * slope - 0.5 * residual * scale * (1.0 - bs * s));
    ++*iterations;
    // log1p(b (s - step)) by its series about s: x is below 1e-2 after the series start.
    const double x = b * step / (1.0 + bs);
    exponent = drained - x * (1.0 + x * (0.5 + x * (1.0 / 3.0 + x * (0.25 + x * (0.2 + x / 6.0)))));
    s -= step;
    if (std::abs(step) < kStepDone * s) break;
  }
  return exponent;
}

/// The same everywhere, edges included. Slower: most of the domain is solve_inside's.
double solve_at_edge(double target, double b, double d, double exponent_max, int* iterations) noexcept {
  const double bound =
      b * target - b * std::log(b) / d;  // v T_r if the current decayed completely, from above
  constexpr double kDecayed = 45.0;      // exp(-45) is below one ulp
  if (bound > kDecayed && b * target > kDecayed) return bound;

  constexpr double kSeriesStartBelow = 1.2;
  const double r = std::sqrt(2.0 * target);
  double t = 0.0;
  if (r < kSeriesStartBelow) {
    t = std::log1p(inverse_series(r, b));
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

/// (4.27) without its logarithm, as in DriveCoastCommand, and hardly ever with its exponential: of the series
/// x / expm1(x) = 1 - x/2 + x^2/12 - x^4/720 + ... three terms are too many and four too few for x < 0.
bool discontinuous(double T_r, double full_decay, double v, double b, double d) noexcept {
  if (!(T_r > 0.0)) return v < b;
  const double x = (v - 1.0) * T_r;
  const double limit = -d * full_decay;
  if (x >= 0.0) return false;
  const double x2 = x * x;
  const double above = limit * (1.0 - 0.5 * x + x2 * (1.0 / 12.0));
  if (x < above) return true;
  if (x > above - limit * x2 * x2 * (1.0 / 720.0)) return false;
  return std::expm1(x) < limit;
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
  const double flows_on = sign_ * (2.0 * v_ - 1.0 - w);  // (4.29)
  if (b == 0.0) return flows_on;
  if (!(T_r_ > 0.0)) return v_ > b ? flows_on : 0.0;  // (4.30), T_r -> 0
  // (4.27) without its logarithm: v > boundary where exp(-(1 - v) T_r) > b + d exp(-T_r)
  if (off_decay_ < d * full_decay_) return flows_on;
  return sign_ * 2.0 * (v_ * d - b / T_r_ * std::log1p(d / b * drained_));  // (4.30)
}

// Volt-seconds over a period balance as without drop at another speed and on another scale of current.
double DriveCoastCommand::mean_current(double omega_r, double opposing) const noexcept {
  const double scale = 0.5 * (1.0 + opposing);
  const double shifted = std::clamp(omega_r, -1.0, 1.0) + sign_ * (scale - 1.0);
  return scale * mean_current(shifted / scale);
}

double drive_coast_mean_current(double T_r, double omega_r, double u) noexcept {
  return DriveCoastCommand(T_r, u).mean_current(omega_r);
}

DriveCoastInverse::DriveCoastInverse(double T_r) noexcept : T_r_(T_r), full_decay_(-std::expm1(-T_r)) {}

DriveCoastSolution DriveCoastInverse::solve(double omega_r, double i_over_is) const noexcept {
  if (i_over_is == 0.0) return {};
  const double sign = i_over_is < 0.0 ? -1.0 : 1.0;
  const double g = std::abs(i_over_is);
  const double w = std::clamp(sign * omega_r, -1.0, 1.0);
  const double b = 0.5 * (1.0 + w);
  const double d = 0.5 * (1.0 - w);
  const double v_continuous = 0.5 * (g + 1.0 + w);  // (4.29)
  if (!discontinuous(T_r_, full_decay_, v_continuous, b, d)) {
    if (v_continuous > 1.0) return {sign, 0, false};
    return {sign * v_continuous, 0, true};
  }
  DriveCoastSolution solution;
  const double target = g * T_r_ / (2.0 * b * d);
  const double r = std::sqrt(2.0 * target);
  constexpr double kEdge = 0.02;
  constexpr double kSmallest = 1e-4;  // below it the difference of the logarithms loses digits
  constexpr double kLargest = 1.2;    // above it the series start is poor
  constexpr double kLinear = 1e-20;   // the series' first term is exact; its square may not be representable
  if (r < kLinear) {
    solution.u = sign * std::min(b * r / T_r_, 1.0);
    return solution;
  }
  const bool inside = b > kEdge && d > kEdge && r > kSmallest && r < kLargest;
  const double exponent = inside ? solve_inside(target, r, b, d, &solution.iterations)
                                 : solve_at_edge(target, b, d, T_r_, &solution.iterations);
  solution.u = sign * std::min(exponent / T_r_, 1.0);
  return solution;
}

DriveCoastSolution drive_coast_invert(double T_r, double omega_r, double i_over_is) noexcept {
  return DriveCoastInverse(T_r).solve(omega_r, i_over_is);
}

}  // namespace equipoise
