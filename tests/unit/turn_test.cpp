// Rotations in the plane: the series for small angles, and turning a little further.
#include <gtest/gtest.h>

#include "equipoise/types.hpp"

namespace equipoise {
namespace {

TEST(Turn, OfASmallAngleIsRightToTenDigits) {
  for (double angle = -0.2; angle <= 0.2; angle += 0.01) {
    EXPECT_NEAR(Turn::small(angle).cosine(), std::cos(angle), 1e-10) << angle;
    EXPECT_NEAR(Turn::small(angle).sine(), std::sin(angle), 1e-10) << angle;
  }
}

TEST(Turn, NearAnotherIsThatOfItsAngle) {
  const double from = 1.3;
  for (const double by : {0.0, 1e-4, -0.0299, 0.0301, -2.5}) {
    const Turn turn = Turn(from).near(from + by, by);
    EXPECT_NEAR(turn.cosine(), std::cos(from + by), 1e-15) << by;
    EXPECT_NEAR(turn.sine(), std::sin(from + by), 1e-15) << by;
  }
}

TEST(Turn, OneAfterAnotherTurnsByBoth) {
  const Vec2 v(0.4, -1.1);
  EXPECT_LT(((Turn(0.7) * Turn(-1.9))(v)-Turn(-1.2)(v)).norm(), 1e-15);
  EXPECT_LT((Turn(0.7).back(Turn(0.7)(v)) - v).norm(), 1e-15);
}

}  // namespace
}  // namespace equipoise
