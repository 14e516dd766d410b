// Root of a mean square, as it grows. In: squares -> out: their root mean, NaN of nothing.
#pragma once

#include <cmath>

namespace equipoise::app {

struct RootMeanSquare {
  double sum = 0.0;
  double count = 0.0;

  /// `squares`: summed over so many axes.
  void add(double squares, int axes = 1) {
    sum += squares;
    count += axes;
  }
  double value() const { return count > 0.0 ? std::sqrt(sum / count) : std::nan(""); }
};

}  // namespace equipoise::app
