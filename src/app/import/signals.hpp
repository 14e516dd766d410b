// Series of one value per tick: filters and sums that the checks of an import need; a median. Not RT-safe.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "equipoise/types.hpp"

namespace equipoise::app {

using Series = Eigen::ArrayXd;

inline constexpr double kLow_Hz = 0.5;  // balancing moves in this band: below it biases, above it vibration
inline constexpr double kHigh_Hz = 5.0;

inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// First-order low-pass.
inline Series smooth(Series x, double hz) {
  const double share = 1.0 - std::exp(-2.0 * kPi * hz * kTickS);
  double s = x(0);
  for (double& each : x) each = s += share * (each - s);
  return x;
}

/// Without vibration, of any number of signals alike: their phases to each other stay.
inline Series slow(const Series& x) { return smooth(smooth(x, kHigh_Hz), kHigh_Hz); }

/// What balancing moves, of signals alike, too.
inline Series balancing(const Series& x) {
  const Series quiet = slow(x);
  return smooth(quiet - smooth(quiet, kLow_Hz), 2.0 * kHigh_Hz);
}

inline Series derivative(const Series& x) {
  Series y = Series::Zero(x.size());
  const Eigen::Index inner = x.size() - 2;
  y.segment(1, inner) = (x.tail(inner) - x.head(inner)) / (2.0 * kTickS);
  return y;
}

inline Series integral(const Series& x) {
  Series y = Series::Zero(x.size());
  for (Eigen::Index k = 1; k < x.size(); ++k) y(k) = y(k - 1) + 0.5 * kTickS * (x(k) + x(k - 1));
  return y;
}

}  // namespace equipoise::app
