// Margins of loops whose margins are known in closed form.
#include "equipoise/control/margins.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace equipoise {
namespace {

using Complex = std::complex<double>;
constexpr Complex kJ{0.0, 1.0};
constexpr double kPeriod_s = 0.005;
const double kNyquist_rad_s = std::acos(-1.0) / kPeriod_s;
const double kHalfPi = 0.5 * std::acos(-1.0);

Margins of(const std::function<Complex(double)>& loop, double centre_rad_s = 0.0, double slow_rad_s = 0.0) {
  const std::vector<double> w = frequency_grid(kPeriod_s, 2000, centre_rad_s);
  std::vector<Complex> L;
  L.reserve(w.size());
  for (const double at : w) L.push_back(loop(at));
  return margins(w, L, centre_rad_s, slow_rad_s);
}

TEST(FrequencyGrid, IsLogarithmicOnBothSidesUpToHalfTheSampling) {
  const std::vector<double> w = frequency_grid(kPeriod_s, 5, 0.0);
  ASSERT_EQ(w.size(), 10U);
  EXPECT_TRUE(std::is_sorted(w.begin(), w.end()));
  for (int i = 0; i < 5; ++i) {
    const double expected = kNyquist_rad_s * std::pow(10.0, i - 4);
    EXPECT_NEAR(w[static_cast<std::size_t>(5 + i)], expected, 1e-9 * expected);
    EXPECT_EQ(w[static_cast<std::size_t>(4 - i)], -w[static_cast<std::size_t>(5 + i)]);
  }
}

TEST(FrequencyGrid, LooksCloselyAtTheCentreToo) {
  const std::vector<double> w = frequency_grid(kPeriod_s, 5, 30.0);
  const auto has = [&](double at) {
    return std::any_of(w.begin(), w.end(), [&](double x) { return std::abs(x - at) < 1e-9; });
  };
  const double first = 1e-4 * kNyquist_rad_s;
  for (const double at : {first, -first, 30.0 + first, 30.0 - first, 30.0 + 0.1 * kNyquist_rad_s})
    EXPECT_TRUE(has(at)) << at;
  EXPECT_TRUE(std::is_sorted(w.begin(), w.end()));
  EXPECT_LE(w.back(), kNyquist_rad_s * (1.0 + 1e-9));
  EXPECT_GE(w.front(), -kNyquist_rad_s * (1.0 + 1e-9));
}

TEST(Margins, OfAnUnstablePlantSayHowFarTheGainMayFall) {
  // L = k (s + 2)/(s (s - 1)): at w = sqrt(2) it is -k.
  const Margins m = of([](double w) { return 2.0 * (kJ * w + 2.0) / (kJ * w * (kJ * w - 1.0)); });
  EXPECT_NEAR(m.gain_down_dB, -20.0 * std::log10(2.0), 1e-3);
  EXPECT_TRUE(std::isinf(m.gain_up_dB));
}

TEST(Margins, OfThreeLagsSayHowFarTheGainMayRise) {
  // L = 2 / (s + 1)^3: -1/4 at w = sqrt(3); of size one at w^2 = 2^(2/3) - 1, three times atan(w) late.
  const Margins m = of([](double w) { return 2.0 / std::pow(kJ * w + 1.0, 3.0); });
  EXPECT_NEAR(m.gain_up_dB, 20.0 * std::log10(4.0), 1e-3);
  EXPECT_TRUE(std::isinf(m.gain_down_dB)) << m.gain_down_dB;
  const double w = std::sqrt(std::cbrt(4.0) - 1.0);
  const double phase_rad = 2.0 * kHalfPi - 3.0 * std::atan(w);
  EXPECT_NEAR(m.phase_deg, phase_rad * 90.0 / kHalfPi, 0.01);
  EXPECT_NEAR(m.delay_s, phase_rad / w, 1e-4);
}

TEST(Margins, OfAnIntegratorFillHalfThePlane) {
  // |1 + L| = |1 - L| where L is imaginary.
  EXPECT_NEAR(of([](double w) { return 10.0 / (kJ * w); }).disk, 2.0, 1e-9);
}

TEST(Margins, TheDiskIsTheNearestApproach) {
  // L = 1/2 everywhere: 2 (1.5/0.5); L = -1/2: 2 (0.5/1.5).
  EXPECT_NEAR(of([](double) { return Complex(0.5, 0.0); }).disk, 6.0, 1e-12);
  EXPECT_NEAR(of([](double w) { return Complex(w > 1.0 ? -0.5 : 0.5, 0.0); }).disk, 2.0 / 3.0, 1e-12);
}

TEST(Margins, WhatIsSlowDoesNotCount) {
  const auto integrator = [](double w) { return 10.0 / (kJ * w); };
  EXPECT_NEAR(of(integrator, 0.0, 9.0).phase_deg, 90.0, 0.01);
  EXPECT_TRUE(std::isinf(of(integrator, 0.0, 11.0).phase_deg));
  EXPECT_EQ(margins({2.0}, {0.5}, 0.0, 2.0).disk, 6.0) << "what is as fast as that does";
  EXPECT_EQ(margins({0.5}, {0.5}, 0.0).disk, 6.0) << "nothing is, unless told so";
}

TEST(Margins, AroundACentreCountTheDelayFromTheWholeFrequency) {
  // Crossings at 30 +- 10 rad/s: a quarter turn of lead at 40, three quarters at 20.
  const Margins m = of([](double w) { return 10.0 / (kJ * (w - 30.0)); }, 30.0);
  EXPECT_NEAR(m.phase_deg, 90.0, 0.01);
  EXPECT_NEAR(m.delay_s, kHalfPi / 40.0, 1e-5);
  const Margins mirrored = of([](double w) { return 10.0 / (kJ * (w + 30.0)); }, -30.0);
  EXPECT_NEAR(mirrored.delay_s, kHalfPi / 40.0, 1e-5) << "of negative frequencies, too";
  EXPECT_TRUE(std::isinf(of([](double w) { return 10.0 / (kJ * (w - 30.0)); }, 30.0, 11.0).phase_deg))
      << "slow is near the centre, too";
}

/// An integrator turned by 40 degrees jumps there from one side to the other; its gain may change at will.
TEST(Margins, TheCurveIsNotFollowedThroughZeroAndTheCentre) {
  for (const double turned_rad : {0.7, -0.7}) {
    for (const double centre_rad_s : {0.0, 30.0, -30.0}) {
      const Margins m =
          of([=](double w) { return 10.0 / (kJ * (w - centre_rad_s)) * std::polar(1.0, turned_rad); },
             centre_rad_s);
      EXPECT_TRUE(std::isinf(m.gain_up_dB)) << centre_rad_s << " " << m.gain_up_dB;
      EXPECT_TRUE(std::isinf(m.gain_down_dB)) << centre_rad_s << " " << m.gain_down_dB;
      EXPECT_NEAR(m.phase_deg, 90.0 - 0.7 * 90.0 / kHalfPi, 0.01);
    }
  }
}

TEST(Margins, NorThroughZeroWhereTheCentreIsElsewhere) {
  const Margins m = of([](double w) { return 10.0 / (kJ * w) * std::polar(1.0, 0.7); }, 30.0);
  EXPECT_TRUE(std::isinf(m.gain_up_dB)) << m.gain_up_dB;
  EXPECT_TRUE(std::isinf(m.gain_down_dB)) << m.gain_down_dB;
}

TEST(Margins, UpToTheCentreItIs) {
  const std::vector<Complex> L{-std::polar(2.0, 0.5), -std::polar(0.5, 0.5), -std::polar(0.5, 0.5)};
  EXPECT_NEAR(margins({1.0, 2.0, 4.0}, L, 3.0).phase_deg, 0.5 * 90.0 / kHalfPi, 1e-9);
}

TEST(Margins, AJumpFromTheFarSideIsNoCrossing) {
  EXPECT_TRUE(std::isinf(
      margins({1.0, 2.0}, {-std::polar(2.0, 2.0), -std::polar(2.0, -1.0)}, 0.0, 0.0).gain_down_dB));
  EXPECT_FALSE(std::isinf(
      margins({1.0, 2.0}, {-std::polar(2.0, 1.0), -std::polar(2.0, -1.0)}, 0.0, 0.0).gain_down_dB));
}

/// Points on the unit circle and on the real axis themselves.
TEST(Margins, ACrossingMayBeAPointOfTheCurve) {
  const Margins on_the_circle = margins({1.0, 2.0}, {-std::polar(1.0, 0.5), -std::polar(0.5, 0.5)}, 0.0);
  EXPECT_NEAR(on_the_circle.phase_deg, 0.5 * 90.0 / kHalfPi, 1e-9);
  EXPECT_NEAR(on_the_circle.delay_s, 0.5, 1e-9);
  const Margins at_its_end = margins({1.0, 2.0}, {-std::polar(0.5, 0.5), -std::polar(1.0, 0.5)}, 0.0);
  EXPECT_NEAR(at_its_end.delay_s, 0.25, 1e-9);
  const Margins on_the_axis = margins({1.0, 2.0}, {-std::polar(2.0, 0.5), -std::polar(2.0, 0.0)}, 0.0);
  EXPECT_NEAR(on_the_axis.gain_down_dB, -20.0 * std::log10(2.0), 1e-9);
  const Margins at_the_limit = margins({1.0, 2.0}, {-std::polar(1.0, 0.5), -std::polar(1.0, -0.5)}, 0.0);
  EXPECT_EQ(at_the_limit.gain_up_dB, 0.0);
  EXPECT_EQ(at_the_limit.gain_down_dB, 0.0);
}

TEST(Margins, ASegmentThatEndsBeforeZeroCounts) {
  const Complex before = -std::polar(2.0, -0.5), behind = -std::polar(0.5, -0.5);
  EXPECT_NEAR(margins({-2.0, -1.0, 1.0}, {before, behind, behind}, 0.0).phase_deg, 0.5 * 90.0 / kHalfPi,
              1e-9);
}

TEST(Margins, AGainThatMayFallByHalfADecibelSaysNothingOfItsRise) {
  const double size = std::pow(10.0, 0.5 / 20.0);
  const Margins m = margins({1.0, 2.0}, {-std::polar(size, 0.1), -std::polar(size, -0.1)}, 0.0);
  EXPECT_NEAR(m.gain_down_dB, -0.5, 1e-9);
  EXPECT_TRUE(std::isinf(m.gain_up_dB));
}

/// Half of the way in size, in angle and in frequency.
TEST(Margins, BetweenTwoPointsTheCurveIsFollowed) {
  const Margins m = margins({1.0, 3.0}, {-std::polar(2.0, 0.25), -std::polar(0.5, 0.75)}, 0.0);
  EXPECT_NEAR(m.phase_deg, 0.5 * 90.0 / kHalfPi, 1e-9);
  EXPECT_NEAR(m.delay_s, 0.5 / 2.0, 1e-9);
  EXPECT_TRUE(std::isinf(m.gain_up_dB)) << "no further than the second: the axis is not reached";
  EXPECT_TRUE(std::isinf(m.gain_down_dB));
  const Margins late = margins({1.0, 3.0}, {-std::polar(2.0, -0.25), -std::polar(0.5, -0.75)}, 0.0);
  EXPECT_NEAR(late.phase_deg, 0.5 * 90.0 / kHalfPi, 1e-9);
  EXPECT_NEAR(late.delay_s, (4.0 * kHalfPi - 0.5) / 2.0, 1e-9) << "nearly a whole turn";
  EXPECT_TRUE(std::isinf(margins({0.5}, {-std::polar(2.0, 0.25)}, 0.0).phase_deg)) << "one point is none";
}

}  // namespace
}  // namespace equipoise
