#include "equipoise/estimate/time_base.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

using Base = TimeBase<1, 2>;

Vec<1> input(double u) { return Vec<1>::Constant(u); }

/// After ticks with inputs 1, 2, 3 and wheels that turn at 1 and -2 rad/s.
Base after_three_ticks(double age_s, Base::Flags known = {true, true}) {
  Base base(age_s);
  base.reset(Vec2::Zero());
  for (int k = 1; k <= 3; ++k) {
    base.advance(input(k));
    base.observe(Vec2(1.0, -2.0) * (k * kTickS), known);
  }
  return base;
}

TEST(TimeBase, WithoutAgeIsNow) {
  const Base base = after_three_ticks(0.0);
  EXPECT_DOUBLE_EQ(base.acted()(0), 3.0);
  EXPECT_EQ(base.stood([] { return Vec2(9.0, 9.0); }), Vec2(3.0 * kTickS, -6.0 * kTickS));
  int steps = 0;
  base.to_now([&steps](const Vec<1>&, double) { ++steps; });
  EXPECT_EQ(steps, 0);
}

TEST(TimeBase, MixesInputsAndInterpolatesAnglesAtTheAge) {
  const Base base = after_three_ticks(0.25 * kTickS);
  EXPECT_DOUBLE_EQ(base.acted()(0), 0.75 * 3.0 + 0.25 * 2.0);
  EXPECT_LT((base.stood([] { return Vec2(9.0, 9.0); }) - Vec2(2.75, -5.5) * kTickS).norm(), 1e-12);
}

TEST(TimeBase, LeadsFromThenToNowThroughTheInputsThatActed) {
  const Base base = after_three_ticks(1.25 * kTickS);
  EXPECT_DOUBLE_EQ(base.acted()(0), 0.75 * 2.0 + 0.25 * 1.0);
  EXPECT_LT((base.stood([] { return Vec2(9.0, 9.0); }) - Vec2(1.75, -3.5) * kTickS).norm(), 1e-12);
  double time = 0.0;
  double impulse = 0.0;
  base.to_now([&](const Vec<1>& u, double dt) {
    time += dt;
    impulse += u(0) * dt;
  });
  EXPECT_NEAR(time, 1.25 * kTickS, 1e-12);
  EXPECT_NEAR(impulse, (0.25 * 2.0 + 3.0) * kTickS, 1e-12);
}

TEST(TimeBase, BridgesAMissingSampleWithTheRate) {
  Base base = after_three_ticks(0.5 * kTickS);
  base.advance(input(4.0));
  base.observe(Vec2(4.0, 50.0) * kTickS, {true, false});
  EXPECT_LT((base.stood([] { return Vec2(9.0, 10.0); }) - Vec2(3.5, 45.0) * kTickS).norm(), 1e-12);
  base.advance(input(5.0));
  base.observe(Vec2(5.0, -10.0) * kTickS, {true, true});  // the one before was not known
  EXPECT_LT((base.stood([] { return Vec2(9.0, -2.0); }) - Vec2(4.5, -9.0) * kTickS).norm(), 1e-12);
}

TEST(TimeBase, KeepsAnAgeWithinItsMemory) {
  EXPECT_DOUBLE_EQ(Base(1.0).age_s(), Base::kMaxAge_s);
  EXPECT_LT(
      (after_three_ticks(1.0).stood([] { return Vec2(Vec2::Zero()); }) - Vec2(1.0, -2.0) * kTickS).norm(),
      1e-12);
}

}  // namespace
}  // namespace equipoise
