// What the gyro's watch is made of: how a gyro lies, how much it shakes, what it said of late, and the axes
// whose rate is known without a torque.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "equipoise/estimate/gyro_watch.hpp"

namespace equipoise {
namespace {

TEST(GyroLies, AreThreeFlipsAndThreeSwapsOfEitherSignEachItsOwnInverse) {
  const Vec3 truth(1.0, 2.0, 3.0);
  const Vec3 told[] = {{-1, 2, 3}, {1, -2, 3},  {1, 2, -3},  {2, 1, 3},  {1, 3, 2},
                       {3, 2, 1},  {-2, -1, 3}, {1, -3, -2}, {-3, 2, -1}};
  for (std::size_t i = 0; i < kGyroLies.size(); ++i) {
    EXPECT_EQ(kGyroLies[i](truth), told[i]) << i;
    EXPECT_EQ(kGyroLies[i](told[i]), truth) << i;
  }
}

/// Back and forth with every sample: a second difference of four times that.
void shake(GyroNoise& noise, double rad_s, int samples) {
  for (int i = 0; i < samples; ++i) noise.hear(Vec3(0.0, i % 2 == 0 ? rad_s : -rad_s, 0.1 * rad_s));
}

TEST(GyroNoiseTest, IsTheMeanSecondDifferenceOfTheWorstAxis) {
  GyroNoise noise;
  shake(noise, 0.1, 2);
  EXPECT_EQ(noise.rad_s(), 0.0) << "of two samples there is none";
  noise.hear(Vec3(0.0, 0.1, 0.01));
  EXPECT_NEAR(noise.rad_s(), 0.05 * 0.4, 1e-12);
  noise.hear(Vec3(0.0, -0.1, 0.01));
  EXPECT_NEAR(noise.rad_s(), (1.0 - 0.95 * 0.95) * 0.4, 1e-12);
}

TEST(GyroNoiseTest, ARateThatGrowsEvenlyIsNone) {
  GyroNoise noise;
  for (int i = 0; i < 50; ++i) noise.hear(Vec3(0.5 * i, -0.25 * i, 7.0));
  EXPECT_EQ(noise.rad_s(), 0.0);
}

TEST(GyroNoiseTest, OneBadSampleIsNotMoreThanThreeOfTheMost) {
  GyroNoise noise;
  for (int i = 0; i < 10; ++i) noise.hear(Vec3(i == 5 ? 100.0 : 0.0, 0.0, 0.0));
  EXPECT_NEAR(noise.rad_s(), (1.0 - std::pow(0.95, 3)) * std::pow(0.95, 2), 1e-12);
}

TEST(GyroNoiseTest, IsTooMuchAboveSixTenths) {
  GyroNoise noise;
  shake(noise, 10.0, 2 + 17);  // 1 - 0.95^17 = 0.58
  EXPECT_FALSE(noise.too_much());
  GyroNoise more;
  shake(more, 10.0, 2 + 18);
  EXPECT_TRUE(more.too_much());
}

/// Against sums over all that was said; long enough that each place of the ring is the first once.
TEST(GyroHistoryTest, GivesMeansChangesAndTurnsOfTheLatestTicks) {
  using History = GyroHistory<2, 6>;
  static_assert(History::kKept == 13);
  History history;
  std::vector<Vec3> gyro;  // latest first
  std::vector<Vec2> angle;
  for (std::size_t i = 1; i <= 40; ++i) {
    const auto n = static_cast<double>(i);
    gyro.insert(gyro.begin(), Vec3(n * n, -n, std::sqrt(n)));
    angle.insert(angle.begin(), Vec2(n * n * n, 5.0 * std::sqrt(n)));
    history.add(gyro[0], angle[0]);
    EXPECT_EQ(history.samples(), std::min<std::size_t>(i, 13));
    EXPECT_EQ(history.gyro_rad_s(), gyro[0]);
    for (const std::size_t half : {std::size_t{3}, std::size_t{6}}) {
      if (history.samples() < History::span(half)) continue;
      Vec3 mean = Vec3::Zero();
      Vec3 before = Vec3::Zero();
      for (std::size_t k = 0; k < half; ++k) {
        mean += gyro[k] / static_cast<double>(half);
        before += gyro[half + k] / static_cast<double>(half);
      }
      const History::Span span = half == 3 ? history.latest<3>() : history.latest<6>();
      EXPECT_LT((span.mean_rad_s - mean).norm(), 1e-9);
      EXPECT_LT((span.change_rad_s - (mean - before)).norm(), 1e-9);
      EXPECT_LT((span.turned_rad - (angle[0] - angle[half])).norm(), 1e-9);
      EXPECT_LT((span.turned_more_rad - (angle[0] - 2.0 * angle[half] + angle[2 * half])).norm(), 1e-9);
    }
    if (history.samples() < 8) continue;
    const Vec2 now(1e5, -7.0);
    const Vec2 turned_more = now - angle[2] - (angle[3] - angle[6]);
    EXPECT_LT((history.turned_more_rad(now, 3, 4) - turned_more).norm(), 1e-9);
  }
  history.forget();
  EXPECT_EQ(history.samples(), 0U);
}

/// Turns evenly about x, which the filter knows, and back and forth about z, which the wheels know.
class KnownRates {
 public:
  KnownRates() : watch_(params()) {}

  static GyroWatchParams<2> params() {
    GyroWatchParams<2> p;
    p.by_rate = {true, false, true};
    p.from_wheels.row(2) << 0.5, -0.5;
    p.yaw_from_wheels << 0.5, -0.5;
    return p;
  }

  /// Ticks until the gyro is not trusted; `lie`: what it makes of the truth.
  template <class Lie>
  int run(double about_x_rad_s, double about_z_rad_s, Lie&& lie, int ticks = 400) {
    for (int i = 1; i <= ticks; ++i) {
      const double z_rad_s = about_z_rad_s * std::sin(8.0 * kTickS * i);
      Measurement<2> z;
      z.imu_ok = z.encoders_ok = true;
      z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
      z.gyro_B_rad_s = lie(Vec3(about_x_rad_s, 0.0, z_rad_s));
      angle_ += kTickS * Vec2(z_rad_s, -z_rad_s);
      z.wheel_angle_rad = angle_;
      watch_.screen(z, z.gyro_B_rad_s, Vec2::Zero());  // the filter follows the gyro
      GyroWitness<2> witness;
      witness.rate_rad_s.x() = about_x_rad_s;
      watch_.compare(z, witness);
      if (!watch_.trusted()) return i;
    }
    return 0;
  }

 private:
  GyroWatch<2> watch_;
  Vec2 angle_ = Vec2::Zero();
};

Vec3 truth(const Vec3& omega) { return omega; }
Vec3 flipped_x(const Vec3& omega) { return {-omega.x(), omega.y(), omega.z()}; }
Vec3 flipped_z(const Vec3& omega) { return {omega.x(), omega.y(), -omega.z()}; }

TEST(GyroWatchOfKnownRates, TrustsTheTruthAndWhatRadiiAndMountExplain) {
  EXPECT_EQ(KnownRates().run(3.0, 6.0, truth), 0);
  EXPECT_EQ(KnownRates().run(3.0, 6.0, [](const Vec3& omega) { return Vec3(1.1 * omega); }), 0);
}

TEST(GyroWatchOfKnownRates, FindsAFlippedAxisOnceItsRateIsBeyondTheirErrors) {
  // Twice the rate against the root of 60 times its sigma, 0.25 rad/s and 6.5 % of the rate: from 1.29 rad/s
  // on.
  EXPECT_EQ(KnownRates().run(1.2, 0.0, flipped_x), 0);
  const int found = KnownRates().run(1.36, 0.0, flipped_x);
  EXPECT_GT(found, 0);
  EXPECT_LE(found, 12) << "seven samples, and proof of four more";
}

TEST(GyroWatchOfKnownRates, WhatAnEncoderExplainsAsWellIsNotHeldAgainstTheGyro) {
  EXPECT_EQ(KnownRates().run(0.0, 6.0, flipped_z), 0);
}

TEST(GyroWatchTest, AJoltIsNoSample) {
  GyroWatch<2> watch{GyroWatchParams<2>()};
  for (const double g : {3.9, 4.1, 3.9}) {
    Measurement<2> z;
    z.imu_ok = true;
    z.accel_B_m_s2 = Vec3(0.0, -g * kGravity_m_s2, 0.0);
    watch.screen(z, Vec3::Zero(), Vec2::Zero());
    EXPECT_EQ(z.imu_ok, g < 4.0) << g;
  }
  EXPECT_TRUE(watch.trusted());
}

}  // namespace
}  // namespace equipoise
