#include "equipoise/control/gain_schedule.hpp"

#include <gtest/gtest.h>

#include "equipoise/control/friction.hpp"

namespace equipoise {
namespace {

GainSchedule<2> schedule(std::size_t rows) {
  GainSchedule<2> s;
  s.at = {0.0, 2.0, 3.0};
  s.row = {{{1.0, -1.0}, {5.0, -2.0}, {7.0, 0.0}}};
  s.rows = rows;
  return s;
}

TEST(GainSchedule, IsLinearBetweenItsRowsAndExactOnThem) {
  const GainSchedule<2> s = schedule(3);
  const auto at = [&](double x) { return s(x); };
  EXPECT_EQ(at(0.0), (std::array<double, 2>{1.0, -1.0}));
  EXPECT_EQ(at(0.5), (std::array<double, 2>{2.0, -1.25}));
  EXPECT_EQ(at(2.0), (std::array<double, 2>{5.0, -2.0}));
  EXPECT_EQ(at(2.5), (std::array<double, 2>{6.0, -1.0}));
  EXPECT_EQ(at(3.0), (std::array<double, 2>{7.0, 0.0}));
}

TEST(GainSchedule, HoldsItsEnds) {
  EXPECT_EQ(schedule(3)(-1.0), (std::array<double, 2>{1.0, -1.0}));
  for (const double beyond : {3.5, 100.0}) EXPECT_EQ(schedule(3)(beyond), (std::array<double, 2>{7.0, 0.0}));
  EXPECT_EQ(schedule(2)(100.0), (std::array<double, 2>{5.0, -2.0})) << "rows beyond the last are none";
  EXPECT_EQ(schedule(1)(100.0), (std::array<double, 2>{1.0, -1.0}));
}

// [T] (6.14)-(6.15)
TEST(FrictionCompensation, IsTheSmoothedSignTimesWhatIsCompensated) {
  EXPECT_NEAR(FrictionCompensation::smooth_sign(1.5), 1.0 - std::exp(-3.0), 1e-15);
  EXPECT_NEAR(FrictionCompensation::smooth_sign(-1.5), std::exp(-3.0) - 1.0, 1e-15);
  EXPECT_EQ(FrictionCompensation::smooth_sign(0.0), 0.0);
  const FrictionCompensation none;
  EXPECT_EQ(none.compensate<2>(Vec2(9.0, 9.0)), Vec2(0.0, 0.0));
  FrictionCompensation half;
  half.coulomb_u = 0.4;
  EXPECT_NEAR(half.compensate<2>(Vec2(50.0, -50.0)).x(), 0.4, 1e-12) << "all of it, unless told otherwise";
  half.gain = 0.5;
  EXPECT_NEAR(half.compensate<2>(Vec2(50.0, -50.0)).y(), -0.2, 1e-12);
  EXPECT_NEAR(half.compensate<2>(Vec2(50.0, -1.5)).y(), 0.2 * (std::exp(-3.0) - 1.0), 1e-15);
}

}  // namespace
}  // namespace equipoise
