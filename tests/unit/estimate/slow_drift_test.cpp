#include "equipoise/estimate/slow_drift.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

TEST(SlowDrift, WhatCreepsStaysNear) {
  SlowDrift<2> drift;
  drift.reset(Vec2(0.1, 0.0));
  for (int i = 1; i <= 12000; ++i) drift.update(Vec2(0.1 + 1e-3 / 60.0 * kTickS * i * 60.0, 0.0), 0.0, 0.0);
  EXPECT_NEAR(drift.distance(), 0.02, 0.002);  // 1 mrad/s a second, behind by the time constant
}

TEST(SlowDrift, WhatLeavesIsFarAway) {
  SlowDrift<2> drift;
  drift.reset(Vec2(0.1, 0.0));
  drift.update(Vec2(0.1, 0.2), 0.0, 0.0);
  EXPECT_NEAR(drift.distance(), 0.2, 1e-3);
}

TEST(SlowDrift, AKnownCauseExplainsItsShareForAsLongAsTheMeanRemembers) {
  SlowDrift<1> drift;
  drift.reset(Vec<1>(0.0));
  drift.update(Vec<1>(0.05), 0.04, 0.0);
  EXPECT_NEAR(drift.distance(), 0.01, 1e-4);
  drift.update(Vec<1>(0.03), 0.04, 0.0);
  EXPECT_EQ(drift.distance(), 0.0);
  for (int i = 0; i < 4000; ++i) drift.update(Vec<1>(0.05), 0.04, 0.0);  // the cause stays, the mean follows
  EXPECT_EQ(drift.distance(), 0.0);
  drift.update(Vec<1>(0.0), 0.0, 0.0);  // it ends: the mean is still away
  EXPECT_EQ(drift.distance(), 0.0);
  for (int i = 0; i < 4000; ++i) drift.update(Vec<1>(0.0), 0.0, 0.0);  // 20 s later a jump is one again
  drift.update(Vec<1>(0.05), 0.0, 0.0);
  EXPECT_GT(drift.distance(), 0.01);
  drift.reset(Vec<1>(0.2));
  drift.update(Vec<1>(0.25), 0.0, 0.0);
  EXPECT_NEAR(drift.distance(), 0.05, 1e-4);
}

TEST(SlowDrift, WhatIsExcusedOnceIsSoForAsLongAsTheMeanRemembers) {
  SlowDrift<1> drift;
  drift.reset(Vec<1>(0.0));
  drift.excuse(0.2);
  drift.update(Vec<1>(0.15), 0.0, 0.0);
  EXPECT_EQ(drift.distance(), 0.0);
  for (int i = 0; i < 4000; ++i) drift.update(Vec<1>(0.15), 0.0, 0.0);
  EXPECT_EQ(drift.distance(), 0.0);
  for (int i = 0; i < 12000; ++i) drift.update(Vec<1>(0.15), 0.0, 0.0);
  drift.update(Vec<1>(0.0), 0.0, 0.0);
  EXPECT_GT(drift.distance(), 0.1);
}

TEST(SlowDrift, APassingCauseExplainsForAMoment) {
  SlowDrift<1> drift;
  drift.reset(Vec<1>(0.0));
  drift.update(Vec<1>(0.05), 0.0, 0.04);
  EXPECT_NEAR(drift.distance(), 0.01, 1e-4);
  for (int i = 0; i < 400; ++i) drift.update(Vec<1>(0.05), 0.0, 0.0);
  EXPECT_GT(drift.distance(), 0.035);
}

}  // namespace
}  // namespace equipoise
