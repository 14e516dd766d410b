#include "equipoise/estimate/rest_bias.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

const Vec3 kBias(0.01, -0.02, 0.005);

Vec3 after(RestBias* bias, int ticks, const Vec3& rate) {
  Vec3 told = Vec3::Zero();
  for (int i = 0; i < ticks; ++i) told = bias->update(rate);
  return told;
}

TEST(RestBias, IsZeroUntilAQuarterOfASecondOfRest) {
  RestBias bias;
  EXPECT_EQ(after(&bias, 49, kBias), Vec3(0.0, 0.0, 0.0));
  EXPECT_LT((bias.update(kBias) - kBias).norm(), 1e-15);
}

TEST(RestBias, IsTheMeanOfTheStretch) {
  RestBias bias;
  after(&bias, 50, Vec3(0.01, 0.0, 0.0));
  EXPECT_NEAR(after(&bias, 50, Vec3(0.03, 0.0, 0.0)).x(), 0.02, 1e-12);
}

TEST(RestBias, TurningBeginsAnewAndKeepsTheLast) {
  RestBias bias;
  after(&bias, 50, kBias);
  EXPECT_LT((bias.update(Vec3(0.0, 0.0, 0.051)) - kBias).norm(), 1e-15) << "no bias of a calibrated gyro";
  EXPECT_LT((after(&bias, 49, -kBias) - kBias).norm(), 1e-15);
  EXPECT_LT((bias.update(-kBias) + kBias).norm(), 1e-15) << "of the new stretch alone";
}

TEST(RestBias, ALastingOffsetBelowTheLimitIsRestAndAtItIsNot) {
  RestBias bias;
  EXPECT_NEAR(after(&bias, 50, Vec3(0.0, 0.0499, 0.0)).y(), 0.0499, 1e-12);
  RestBias turning;
  EXPECT_EQ(after(&turning, 500, Vec3(0.03, 0.04, 0.0)), Vec3(0.0, 0.0, 0.0));
}

TEST(RestBias, FollowsASlowBiasOverTwoSeconds) {
  RestBias bias;
  after(&bias, 4000, Vec3(0.0, 0.0, 0.0));
  // from there on each sample counts for 1/400
  const double expected = 0.04 * (1.0 - std::pow(1.0 - 1.0 / 400.0, 400));
  EXPECT_NEAR(after(&bias, 400, Vec3(0.04, 0.0, 0.0)).x(), expected, 1e-12);
}

TEST(RestBias, ASampleThatIsNoNumberIsNoRest) {
  RestBias bias;
  after(&bias, 30, kBias);
  bias.update(Vec3(std::nan(""), 0.0, 0.0));
  EXPECT_EQ(after(&bias, 49, kBias), Vec3(0.0, 0.0, 0.0));
}

}  // namespace
}  // namespace equipoise
