#include "app/import/wheel_order.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

constexpr double kLargest_rad = 20.0 * kPi / 180.0;  // a third of what makes one wheel look like another
constexpr double kChange = 0.05;                     // of a mistake, so that the simplest one is named

std::complex<double> direction(const Mat3& axes, int wheel) {
  return std::polar(1.0, std::atan2(axes(1, wheel), axes(0, wheel)));
}

std::string in_words(const WheelOrder& o) {
  const auto flipped = std::count(o.sign.begin(), o.sign.end(), -1);
  const bool moved = o.at != std::array<int, 3>{0, 1, 2};
  if (flipped == 3 && !moved && std::abs(o.azimuth_rad) > kPi - kLargest_rad) return ": gyro z is flipped";
  std::string text;
  if (moved) {
    text = format(": the wheels' columns are wheels %d, %d, %d of the configuration", o.at[0] + 1,
                  o.at[1] + 1, o.at[2] + 1);
    const bool shifted = o.at[0] != 0 && o.at[1] != 1 && o.at[2] != 2;
    if (shifted && flipped == 0) text += ", or robot.wheel_azimuth_deg is 120 degrees off";
  }
  for (std::size_t i = 0; i < 3; ++i)
    if (o.sign[i] < 0)
      text += format("%s the sign of column %zu is flipped", text.empty() ? ":" : ";", i + 1);
  if (std::abs(o.azimuth_rad) > kLargest_rad) {
    text += format("%s robot.wheel_azimuth_deg is off: add %.0f", text.empty() ? ":" : ";",
                   o.azimuth_rad * 180.0 / kPi);
  }
  return text;
}

}  // namespace

WheelOrder wheel_order(const Mat3& configured, const Mat3& measured) {
  WheelOrder best;
  double least = INFINITY;
  std::array<int, 3> at{0, 1, 2};
  do {
    for (int flips = 0; flips < 8; ++flips) {
      WheelOrder o;
      o.at = at;
      std::array<std::complex<double>, 3> off;
      std::complex<double> sum = 0.0;
      double cost = at == std::array<int, 3>{0, 1, 2} ? 0.0 : kChange;
      for (std::size_t i = 0; i < 3; ++i) {
        const int wheel = static_cast<int>(i);
        o.sign[i] = (flips >> wheel) % 2 == 0 ? 1 : -1;
        if (o.sign[i] < 0) cost += kChange;
        if (o.sign[i] * measured(2, wheel) * configured(2, at[i]) < 0.0) cost += 1.0;
        off[i] = static_cast<double>(o.sign[i]) * direction(measured, wheel) / direction(configured, at[i]);
        sum += off[i];
      }
      o.azimuth_rad = std::arg(sum);
      if (std::abs(o.azimuth_rad) > kLargest_rad) cost += 2.0 * kChange;
      for (const std::complex<double>& each : off)
        cost += 1.0 - std::real(each * std::polar(1.0, -o.azimuth_rad));
      if (cost >= least) continue;
      least = cost;
      best = o;
    }
  } while (std::next_permutation(at.begin(), at.end()));
  best.mistake = in_words(best);
  return best;
}

}  // namespace equipoise::app
