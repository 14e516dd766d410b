// Series of one value per tick: filters and sums that the checks of an import need. Not RT-safe.
#pragma once

#include <cmath>
#include <numeric>
#include <vector>

#include "equipoise/types.hpp"

namespace equipoise::app {

using Series = std::vector<double>;

inline constexpr double kLow_Hz = 0.5;  // balancing moves in this band: below it biases, above it vibration
inline constexpr double kHigh_Hz = 5.0;

/// First-order low-pass.
inline Series smooth(const Series& x, double hz) {
  const double share = 1.0 - std::exp(-2.0 * kPi * hz * kTickS);
  Series y;
  double s = x.front();
  for (const double each : x) y.push_back(s += share * (each - s));
  return y;
}

inline Series combine(const Series& a, double factor, const Series& b) {
  Series out(a.size());
  for (std::size_t k = 0; k < a.size(); ++k) out[k] = a[k] + factor * b[k];
  return out;
}

/// What balancing moves, of any number of signals alike: their phases to each other stay.
inline Series balancing(const Series& x) {
  const Series quiet = smooth(smooth(x, kHigh_Hz), kHigh_Hz);
  return smooth(combine(quiet, -1.0, smooth(quiet, kLow_Hz)), 2.0 * kHigh_Hz);
}

inline Series derivative(const Series& x) {
  Series y(x.size(), 0.0);
  for (std::size_t k = 1; k + 1 < x.size(); ++k) y[k] = (x[k + 1] - x[k - 1]) / (2.0 * kTickS);
  return y;
}

inline Series scaled(double factor, Series x) {
  for (double& each : x) each *= factor;
  return x;
}

inline Series integral(const Series& x) {
  Series y(x.size(), 0.0);
  for (std::size_t k = 1; k < x.size(); ++k) y[k] = y[k - 1] + 0.5 * kTickS * (x[k] + x[k - 1]);
  return y;
}

inline Series product(const Series& a, const Series& b) {
  Series out(a.size());
  for (std::size_t k = 0; k < a.size(); ++k) out[k] = a[k] * b[k];
  return out;
}

inline double mean_square(const Series& x) {
  return std::inner_product(x.begin(), x.end(), x.begin(), 0.0) / static_cast<double>(x.size());
}

}  // namespace equipoise::app
