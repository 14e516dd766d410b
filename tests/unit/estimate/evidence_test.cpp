// What a tick's samples say, bounded and unbounded, of filters whose innovations are told.
#include "equipoise/estimate/evidence.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "equipoise/estimate/used_sensors.hpp"
#include "robots/mbbr/mbbr.hpp"

namespace equipoise {
namespace {

using Sample = Mbbr::Sample;

Sample standing() {
  Sample z;
  z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
  z.wheel_angle_rad = Vec3(1.0, 2.0, 3.0);
  z.gyro_B_rad_s = Vec3(0.1, 0.2, 0.3);
  z.imu_ok = z.encoders_ok = true;
  return z;
}

constexpr EvidenceParams kParams{0.01, 0.01, 0.2, 0.5, {}};

/// A filter whose innovations are told.
struct Told {
  struct Model {
    static constexpr int kOutputs = 8, kWheel = 3;
  };
  std::array<double, 8> innovation{}, variance{};
  const std::array<double, 8>& row_innovation() const { return innovation; }
  const std::array<double, 8>& row_variance() const { return variance; }
  Vec3 rate_rad_s = Vec3::Zero();
  Vec3 wheel_rate_rad_s() const { return rate_rad_s; }
};

/// Filters drawn at random, `share` from 0 to 1.
struct EvidenceOfAny : testing::Test {
  Evidence<Told, 3> evidence{kParams};
  const Sample all = standing();
  std::mt19937 random;
  double share() { return std::uniform_real_distribution<double>(0.0, 1.0)(random); }
  EvidenceOfAny() { evidence.reset(0.0); }
};

TEST(Evidence, OneTickSaysNoMoreThanItsBound) {
  using TheEvidence = Evidence<Told, 3>;
  TheEvidence evidence(EvidenceParams{0.01, 0.02, 0.2, 0.0, {}});
  evidence.reset(0.0);
  Told filter;
  filter.variance.fill(1e-4);
  const Sample z = standing();
  const double as_expected = evidence.expect(filter, z, z);
  // The model's error of two sigma: 0.5 of a squared normal number in place of four.
  filter.innovation[3] = 0.02;
  EXPECT_NEAR(as_expected - evidence(filter, z, z), 0.5, 1e-4);
  filter.innovation[3] = 10.0;
  EXPECT_NEAR(as_expected - evidence(filter, z, z), TheEvidence::kOutlier, 1e-3);
  filter.innovation[3] = NAN;
  EXPECT_NEAR(as_expected - evidence(filter, z, z), TheEvidence::kOutlier, 1e-3);
}

/// Of 0.2 rad a tick at most, forwards or backwards, where half of the samples may slip.
TEST(Evidence, AWheelThatTurnsAnyhowIsNoFault) {
  Evidence<Told, 3> evidence(kParams);
  evidence.reset(0.0);
  Told filter;
  filter.variance.fill(1e-4);
  const Sample before = standing();
  evidence.hear(before);
  Sample turned = before;
  turned.wheel_angle_rad(0) += 0.1;
  const double as_expected = evidence.expect(filter, turned, turned);
  filter.innovation[3] = 0.1;
  const double floor = std::log(0.5 / (2.0 * 0.2));
  EXPECT_NEAR(as_expected - evidence(filter, turned, turned), -0.5 * std::log(2.0 * kPi * 4e-4) - floor,
              1e-3);
  Sample without = turned;
  without.wheel_ok[0] = false;
  EXPECT_NEAR(evidence(filter, without, turned), evidence(filter, turned, turned), 1e-9);
}

/// Of its reading, whose error stays as it was, nothing is heard twice.
TEST(Evidence, AnEncoderThatStandsIsDeadIfItsWheelTurns) {
  Evidence<Told, 3> evidence(kParams);
  evidence.reset(0.0);
  Told filter;
  filter.variance.fill(1e-4);
  filter.innovation[3] = 0.03;
  const Sample z = standing();
  Sample without = z;
  without.wheel_ok[0] = false;
  const auto faulty = [&] {
    evidence.hear(z);
    evidence.expect(filter, z, z);
    return evidence(filter, without, z) - evidence(filter, z, z);
  };
  EXPECT_NEAR(faulty(), std::log(0.5), 0.15) << "half of the faulty ones stand";
  EXPECT_NEAR(faulty(), std::log(1.0), 0.15) << "this is one of them";
  filter.rate_rad_s.x() = 0.5 * 0.02 / kTickS;
  EXPECT_NEAR(faulty(), std::log(2.0), 0.15) << "a healthy one does so every other time";
  filter.rate_rad_s.x() = 0.02 / kTickS;
  EXPECT_NEAR(faulty(), 0.5 * 0.03 * 0.03 / 4e-4, 0.15) << "a healthy one does not";
}

TEST_F(EvidenceOfAny, AFilterThatUsesLessNeverSaysMoreThanItMay) {
  random.seed(3);
  for (int k = 0; k < 20000; ++k) {
    Told everything, less;
    UsedSensors<3> used;
    for (std::uint32_t bit = 1; bit < 8; bit *= 2) {
      if (share() > 0.7) used.without_axes |= bit;
      if (share() > 0.7) used.without_wheels |= bit;
    }
    used.imu = share() < 0.9;
    for (std::size_t row = 0; row < 8; ++row) {
      everything.variance[row] = std::pow(10.0, -6.0 + 10.0 * share());
      less.variance[row] = everything.variance[row] * (share() < 0.5 ? 1.0 : 1.0 + 4.0 * share());
      everything.innovation[row] = 3.0 * share() * std::sqrt(everything.variance[row]);
      less.innovation[row] = 0.1 * everything.innovation[row];
    }
    evidence.expect(everything, all, all);
    ASSERT_LE(evidence(less, used.of(all), all), evidence.most(all, used, all)) << k;
  }
  const UsedSensors<3> every;
  EXPECT_GE(evidence.most(every.turned_over({FaultHypothesis::kImu, 0}).of(all), every, all),
            decltype(evidence)::kOutlier)
      << "a sensor more: anything";
}

/// The rows before as healthy, those behind as well as they can.
TEST_F(EvidenceOfAny, AFilterThatReadsARowOtherwiseNeverSaysMoreThanItMay) {
  random.seed(6);
  int refuted = 0;
  for (int k = 0; k < 20000; ++k) {
    Told healthy;
    for (std::size_t row = 0; row < 8; ++row) {
      healthy.variance[row] = std::pow(10.0, -6.0 + 7.0 * share());
      healthy.innovation[row] = 3.0 * (2.0 * share() - 1.0) * std::sqrt(healthy.variance[row]);
    }
    const double as_used = evidence.expect(healthy, all, all);
    const std::size_t row = k % 3;
    const double reads = 4.0 * (share() - 0.5);
    Told other = healthy;
    other.innovation[row] += reads - all.gyro_B_rad_s(static_cast<int>(row));
    std::fill(other.innovation.begin() + static_cast<std::ptrdiff_t>(row) + 1, other.innovation.end(), 0.0);
    const double most = evidence.most(healthy, all, row, reads);
    ASSERT_LE(evidence(other, all, all), most) << k;
    refuted += most <= as_used ? 1 : 0;
  }
  EXPECT_GT(refuted, 5000) << "it decides";
}

TEST(Evidence, ATickIsASurpriseThatIsMoreThanNoise) {
  Evidence<Told, 3> evidence(kParams);
  evidence.reset(0.0);
  Told filter;
  filter.variance.fill(1e-2);
  const Sample z = standing();
  evidence.expect(filter, z, z);
  for (const double sigmas : {0.9, 1.1}) {
    filter.innovation.fill(sigmas * 0.1);
    evidence.expect(filter, z, z);
    EXPECT_EQ(evidence.surprises(), sigmas > 1.0) << sigmas;
  }
  filter.innovation.fill(NAN);
  evidence.expect(filter, z, z);
  EXPECT_TRUE(evidence.surprises());
}

TEST_F(EvidenceOfAny, AFilterThatTakesTheImuToBeNoisyNeverSaysMoreThanItMay) {
  random.seed(4);
  for (int k = 0; k < 20000; ++k) {
    Told everything, noisy;
    for (std::size_t row = 0; row < 8; ++row) {
      everything.variance[row] = std::pow(10.0, -6.0 + 7.0 * share());
      const double noise = row < 3 ? 0.15 : row < 6 ? 0.0 : 3.0;
      noisy.variance[row] = everything.variance[row] + noise * noise;
    }
    evidence.expect(everything, all, all);
    const double says = evidence(noisy, all, all);
    ASSERT_LE(says, evidence.most(all, 0.15, 3.0)) << k;
  }
}

TEST_F(EvidenceOfAny, OneLogarithmSaysAsMuchAsOneForEachRow) {
  random.seed(5);
  for (int k = 0; k < 20000; ++k) {
    Told filter;
    for (std::size_t row = 0; row < 8; ++row) {
      filter.variance[row] = std::pow(10.0, -6.0 + 8.0 * share());
      filter.innovation[row] = 12.0 * share() * share() * std::sqrt(filter.variance[row]);
    }
    const double by_row = evidence.expect(filter, all, all);
    ASSERT_NEAR(evidence(filter, all, all), by_row, 1e-11) << k;
  }
}

TEST(Evidence, KnowsWhenTheFilterHasBecomeLessSure) {
  Evidence<Told, 3> evidence(kParams);
  evidence.reset(0.0);
  Told filter;
  filter.variance.fill(1e-4);
  const Sample z = standing();
  evidence.expect(filter, z, z);
  evidence.expect(filter, z, z);
  EXPECT_FALSE(evidence.knows_less());
  filter.variance[4] = 1.2e-4;
  evidence.expect(filter, z, z);
  EXPECT_TRUE(evidence.knows_less());
  evidence.expect(filter, z, z);
  EXPECT_FALSE(evidence.knows_less());
  filter.innovation[0] = NAN;
  evidence.expect(filter, z, z);
  EXPECT_TRUE(evidence.knows_less());
}

TEST(Evidence, AGyroThatShakesIsBelievedLess) {
  using TheEvidence = Evidence<Told, 3>;
  TheEvidence evidence(kParams);
  evidence.reset(0.001);
  std::mt19937 random(1);
  std::normal_distribution<double> shakes(0.0, 0.05);
  Told filter;
  filter.variance.fill(1e-6);
  for (int i = 0; i < 4000; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) filter.innovation[axis] = shakes(random);
    evidence.learn_vibration(filter, standing());
  }
  EXPECT_NEAR(evidence.vibration_rad_s(), 0.05, 0.015);
  EXPECT_NEAR(std::sqrt(evidence.spread(filter, 0)) / 2.0, evidence.vibration_rad_s(), 1e-9);
  EXPECT_NEAR(std::sqrt(evidence.spread(filter, 4)) / 2.0, 0.001, 1e-6) << "an encoder does not shake";
}

TEST(Evidence, WhatIsOffForLongIsNoVibration) {
  Evidence<Told, 3> evidence(kParams);
  evidence.reset(0.001);
  Told filter;
  filter.variance.fill(1e-6);
  for (int i = 0; i < 400; ++i) {  // a bias that ramps
    for (std::size_t axis = 0; axis < 3; ++axis) filter.innovation[axis] = 0.001 * i;
    evidence.learn_vibration(filter, standing());
  }
  EXPECT_LT(evidence.vibration_rad_s(), 0.002);
}

TEST(Evidence, ASpikeIsNoJump) {
  Evidence<Told, 3> evidence(kParams);
  evidence.reset(0.05);
  Told filter;
  filter.variance.fill(1e-6);
  const Sample z = standing();
  evidence.expect(filter, z, z);
  const auto says = [&] { return evidence.jump(filter, z, 0.3); };
  filter.innovation[0] = 0.6;  // six sigma: one sample in twenty is an outlier
  EXPECT_GT(says(), 0.0);
  EXPECT_LT(says(), 4.0);
  filter.innovation[0] = 0.05;
  EXPECT_LT(says(), 0.0) << "what is expected speaks against a jump";
}

}  // namespace
}  // namespace equipoise
