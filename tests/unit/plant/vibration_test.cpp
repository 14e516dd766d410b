// Vibration against its formulas: none at rest, growth with the wheels' rate, colour, bursts, lines.
#include "equipoise/plant/vibration.hpp"

#include <gtest/gtest.h>

#include <complex>
#include <vector>

namespace equipoise {
namespace {

VibrationParams shaken() {
  VibrationParams p;
  p.gyro_sigma_rad_s = Vec3(0.1, 0.05, 0.02);
  p.accel_sigma_m_s2 = Vec3(3.0, 2.0, 1.0);
  return p;
}

/// Of gyro x, wheels at this rate.
std::vector<double> run(const VibrationParams& p, double rate_rad_s, int ticks) {
  Vibration vibration(p, 3, 3);
  std::vector<double> x;
  for (int i = 0; i < ticks; ++i) {
    const double angle = rate_rad_s * kTickS * i;
    const double value = vibration.update(kTickS * i, {angle, -angle, angle, 0.0}).gyro_rad_s.x();
    if (i > 0) x.push_back(value);
  }
  return x;
}

double moment(const std::vector<double>& x, int power) {
  double sum = 0.0;
  for (const double v : x) sum += std::pow(v, power);
  return sum / static_cast<double>(x.size());
}

double lag_1(const std::vector<double>& x) {
  double sum = 0.0;
  for (std::size_t i = 1; i < x.size(); ++i) sum += x[i] * x[i - 1];
  return sum / static_cast<double>(x.size()) / moment(x, 2);
}

/// Power at a frequency over the mean of all.
double line(const std::vector<double>& x, double hz) {
  std::complex<double> sum = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i)
    sum += x[i] * std::polar(1.0, -2.0 * kPi * hz * kTickS * static_cast<double>(i));
  return std::norm(sum) / static_cast<double>(x.size()) / moment(x, 2);
}

TEST(Vibration, NoneAtRestAndHalfOfItAtTheHalfRate) {
  EXPECT_EQ(moment(run(shaken(), 0.0, 1000), 2), 0.0);
  for (const double rate : {0.4, 4.0}) {
    const double expected = 0.1 * rate / (rate + 0.4);
    EXPECT_NEAR(std::sqrt(moment(run(shaken(), rate, 100000), 2)), expected, 0.03 * expected) << rate;
  }
}

TEST(Vibration, ColourIsThatOfThePolePair) {
  // First autocorrelation of an AR(2): a1 / (1 - a2), a1 = 2 r cos w, a2 = -r^2; LOG278 standing: 0.6 to
  // 0.77.
  const double r = std::exp(-kPi * 33.0 / kTickHz);
  const double expected = 2.0 * r * std::cos(2.0 * kPi * 22.0 / kTickHz) / (1.0 + r * r);
  EXPECT_NEAR(lag_1(run(shaken(), 4.0, 100000)), expected, 0.02);
  EXPECT_NEAR(expected, 0.67, 0.02);
}

TEST(Vibration, BurstsHaveTheirKurtosis) {
  VibrationParams p = shaken();
  const auto excess = [](const std::vector<double>& x) {
    return moment(x, 4) / std::pow(moment(x, 2), 2) - 3.0;
  };
  EXPECT_NEAR(excess(run(p, 4.0, 200000)), 0.0, 0.15);
  for (const double kurtosis : {3.0, 7.0}) {
    p.excess_kurtosis = kurtosis;
    EXPECT_NEAR(excess(run(p, 4.0, 400000)), kurtosis, 0.3 * kurtosis);
    EXPECT_NEAR(moment(run(p, 4.0, 200000), 2), std::pow(0.1 * 4.0 / 4.4, 2),
                0.1 * std::pow(0.1 * 4.0 / 4.4, 2));
  }
}

TEST(Vibration, LinesFollowTheWheels) {
  VibrationParams p = shaken();
  p.line_share = 0.5;
  for (const double rate : {2.0 * kPi, 4.0 * kPi}) {  // a turn of the wheels in 1 s, 0.5 s: 12, 24 Hz
    const std::vector<double> x = run(p, rate, 4000);
    const double hz = 12.0 * rate / (2.0 * kPi);
    EXPECT_GT(line(x, hz), 100.0);
    EXPECT_LT(line(x, 1.7 * hz), 20.0);
  }
}

}  // namespace
}  // namespace equipoise
