#include "equipoise/estimate/slow_drift.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

TEST(SlowDrift, WhatCreepsStaysNear) {
  SlowDrift<2> drift;
  drift.reset(Vec2(0.1, 0.0));
  for (int i = 1; i <= 12000; ++i) drift.update(Vec2(0.1 + 1e-3 * kTickS * i, 0.0));
  EXPECT_NEAR(drift.distance_rad_s(), 0.02, 0.002);  // 1 mrad/s a second, behind by the time constant
}

TEST(SlowDrift, WhatLeavesIsFarAway) {
  SlowDrift<2> drift;
  drift.reset(Vec2(0.1, 0.0));
  drift.update(Vec2(-0.1, 0.0));
  EXPECT_NEAR(drift.distance_rad_s(), 0.2, 1e-3);
  drift.reset(Vec2(-0.1, 0.0));
  EXPECT_EQ(drift.distance_rad_s(), 0.0);
}

TEST(SlowDrift, AJumpIsNoDriftForAsLongAsTheMeanRemembers) {
  SlowDrift<1> drift;
  drift.reset(Vec<1>(0.0));
  drift.jumped();
  for (int i = 0; i < 4000; ++i) {
    drift.update(Vec<1>(0.15));
    ASSERT_LT(drift.distance_rad_s(), 1e-9);
  }
  for (int i = 0; i < 12000; ++i) drift.update(Vec<1>(0.15));
  drift.update(Vec<1>(0.0));
  EXPECT_GT(drift.distance_rad_s(), 0.1);
}

}  // namespace
}  // namespace equipoise
