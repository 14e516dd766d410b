#include "equipoise/estimate/rest_bias.hpp"

#include <gtest/gtest.h>

#include <random>

namespace equipoise {
namespace {

const Vec3 kBias(0.01, -0.02, 0.005);

Vec3 after(RestBias* bias, int ticks, const Vec3& rate, double sigma = 0.0) {
  static std::mt19937 random(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  Vec3 told = Vec3::Zero();
  for (int i = 0; i < ticks; ++i)
    told = bias->update(rate + sigma * Vec3(normal(random), normal(random), normal(random)));
  return told;
}

TEST(RestBias, IsNotKnownUntilAQuarterOfASecondOfRest) {
  RestBias bias;
  EXPECT_EQ(after(&bias, 49, kBias), Vec3(0.0, 0.0, 0.0));
  EXPECT_FALSE(bias.known());
  EXPECT_LT((bias.update(kBias) - kBias).norm(), 1e-15);
  EXPECT_TRUE(bias.known());
}

TEST(RestBias, IsTheMeanOfTheStretch) {
  RestBias bias;
  after(&bias, 50, Vec3(0.01, 0.0, 0.0));
  EXPECT_NEAR(after(&bias, 50, Vec3(0.02, 0.0, 0.0)).x(), 0.015, 1e-12);
}

/// MPU-9250, data sheet: a zero-rate output of up to 5 deg/s at 25 degrees C, and 0.24 deg/s per K.
TEST(RestBias, IsFoundWhateverItsSize) {
  for (const double size : {0.05, 0.1, 0.18}) {
    RestBias bias;
    EXPECT_NEAR((after(&bias, 400, Vec3(size, -size, size), 0.0014) - Vec3(size, -size, size)).norm(), 0.0,
                5 * 0.0014 / 20);
  }
}

TEST(RestBias, IsFoundInNoise) {
  RestBias bias;
  const double sigma = 0.2;
  EXPECT_LT((after(&bias, 400, Vec3(0.1, 0.0, 0.0), sigma) - Vec3(0.1, 0.0, 0.0)).norm(), 5 * sigma / 20);
}

/// One sample of garbage in a block is 6 rad/s / 25, and makes that block look so rough that it would do.
TEST(RestBias, GarbageIsNoRest) {
  RestBias bias;
  const Vec3 before = after(&bias, 75, kBias, 0.0014);
  after(&bias, 24, kBias, 0.0014);
  EXPECT_EQ(bias.update(Vec3(-6.4, 3.0, 20.0)), before);
  EXPECT_TRUE(bias.known());
}

TEST(RestBias, MoreThanTheSensorCanHaveIsNoBias) {
  RestBias bias;
  EXPECT_EQ(after(&bias, 4000, Vec3(0.0, 0.0, 0.3), 0.0014), Vec3(0.0, 0.0, 0.0));
  EXPECT_FALSE(bias.known());
}

/// A hand that turns the body by 0.1 rad at 1 Hz: 0.6 rad/s.
TEST(RestBias, TurningByHandIsNoRest) {
  RestBias bias;
  for (int i = 0; i < 1000; ++i) bias.update(kBias + Vec3(0.0, 0.0, 0.6 * std::cos(2.0 * kPi * i * kTickS)));
  EXPECT_FALSE(bias.known());
}

TEST(RestBias, TurningBeginsAnewAndKeepsTheLast) {
  RestBias bias;
  after(&bias, 50, kBias);
  EXPECT_LT((after(&bias, 25, Vec3(0.0, 0.0, 0.5)) - kBias).norm(), 1e-15);
  EXPECT_LT((after(&bias, 25, -kBias) - kBias).norm(), 1e-15);
  EXPECT_LT((after(&bias, 25, -kBias) + kBias).norm(), 1e-15) << "of the new stretch alone";
}

TEST(RestBias, FollowsASlowBiasOverTwoSeconds) {
  RestBias bias;
  after(&bias, 4000, Vec3(0.0, 0.0, 0.0));
  // from there on each block counts for 25/400
  const double expected = 0.01 * (1.0 - std::pow(1.0 - 25.0 / 400.0, 16));
  EXPECT_NEAR(after(&bias, 400, Vec3(0.01, 0.0, 0.0)).x(), expected, 1e-12);
}

TEST(RestBias, TellsATableFromAHand) {
  const double sigma = 0.001;
  RestBias table;
  after(&table, 375, kBias, sigma);
  EXPECT_FALSE(table.stands()) << "a hand may be as still for so long";
  after(&table, 25, kBias, sigma);
  EXPECT_TRUE(table.stands());
  EXPECT_GT(table.scatter_rad_s().minCoeff(), 0.5 * sigma / 5) << "of a mean of 25";
  EXPECT_LT(table.scatter_rad_s().maxCoeff(), 1.8 * sigma / 5);
  RestBias hand;
  for (int i = 0; i < 4000; ++i) {  // sways by 0.005 rad/s at 0.5 Hz
    after(&hand, 1, kBias + Vec3(0.005 * std::sin(kPi * i * kTickS), 0.0, 0.0), sigma);
    EXPECT_FALSE(hand.stands());
  }
}

TEST(RestBias, ASampleThatIsNoNumberIsNoRest) {
  RestBias bias;
  after(&bias, 30, kBias);
  bias.update(Vec3(std::nan(""), 0.0, 0.0));
  EXPECT_EQ(after(&bias, 49, kBias), Vec3(0.0, 0.0, 0.0));
}

}  // namespace
}  // namespace equipoise
