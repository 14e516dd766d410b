#include "equipoise/control/governor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "equipoise/control/allocate.hpp"
#include "equipoise/control/chain.hpp"
#include "robots/mip/design.hpp"

namespace equipoise {
namespace {

constexpr SmoothVelocity<2>::Limits kLimits{0.5, 3.0};

TEST(SmoothVelocity, ReachesTheTargetWithinItsLimitsAndWithoutOvershoot) {
  SmoothVelocity<2> v;
  const Vec2 target(0.3, -0.4);
  Vec2 before = Vec2::Zero();
  for (int k = 0; k < 600; ++k) {
    v.update(target, kLimits);
    EXPECT_LE(v.acceleration().norm(), 0.5 + 1e-9);
    EXPECT_LE((v.acceleration() - before).norm(), 3.0 * kTickS + 1e-9);
    EXPECT_LE(v.velocity().norm(), 0.5 + 1e-9);
    before = v.acceleration();
  }
  EXPECT_LT((v.velocity() - target).norm(), 1e-6);
  EXPECT_LT(v.acceleration().norm(), 1e-6);
}

/// Where the jerk is small against the acceleration, all of it is needed to take that back in time.
TEST(SmoothVelocity, TakesItsAccelerationBackBeforeTheTarget) {
  SmoothVelocity<1> v;
  for (int k = 0; k < 4000; ++k) {
    v.update(Vec<1>(10.0), {4.0, 1.0});
    ASSERT_GE(v.acceleration()(0), -1e-6) << k;
    ASSERT_LE(v.velocity()(0), 10.0 + 1e-6) << k;
  }
  EXPECT_NEAR(v.velocity()(0), 10.0, 1e-6);
}

TEST(SmoothVelocity, StaysWithinItsLimitsWhenTheTargetJumps) {
  SmoothVelocity<2> v;
  Vec2 before = Vec2::Zero();
  for (int k = 0; k < 2000; ++k) {
    const double sign = (k / 37) % 2 == 0 ? 1.0 : -1.0;
    v.update(Vec2(0.5 * sign, (k / 53) % 2 == 0 ? 0.4 : -0.4), kLimits);
    EXPECT_LE(v.acceleration().norm(), 0.5 + 1e-9);
    EXPECT_LE((v.acceleration() - before).norm(), 3.0 * kTickS + 1e-9);
    before = v.acceleration();
  }
}

/// Of the jerk that is fed forward, from `from_s` on.
template <class Target>
double most_jerk(Target&& target, double from_s) {
  SmoothVelocity<2> v;
  double most = 0.0;
  for (int k = 0; k < 2000; ++k) {
    const double t_s = k * kTickS;
    v.update(target(t_s), kLimits);
    if (t_s > from_s) most = std::max(most, v.jerk().norm());
  }
  return most;
}

TEST(SmoothVelocity, GoesAlongWithATargetThatMovesWithoutChatter) {
  const auto circle = [](double t_s) {
    return Vec2(0.1 * std::sin(0.1 * t_s), 0.1 - 0.1 * std::cos(0.1 * t_s));
  };
  EXPECT_LT(most_jerk(circle, 2.0), 0.0011) << "the circle's own is 0.001";
  const auto ramp = [](double t_s) { return Vec2(0.05 * t_s, 0.0); };
  EXPECT_LT(most_jerk(ramp, 2.0), 1e-6);
}

TEST(SmoothVelocity, TakesTheStepsOfACommandLinkWithLessThanItsJerk) {
  const auto stick = [](double t_s) { return Vec2(0.0, 0.05 * 0.02 * std::floor(t_s / 0.02)); };
  EXPECT_LT(most_jerk(stick, 1.0), 0.7 * kLimits.jerk) << "0.05 m/s2, told fifty times a second";
}

TEST(SmoothVelocity, FollowsATargetThatMovesOn) {
  SmoothVelocity<2> v;
  const auto target = [](int k) { return Vec2(0.2 + 0.1 * k * kTickS, 0.0); };
  for (int k = 0; k < 400; ++k) v.update(target(k), kLimits);
  EXPECT_LT((v.velocity() - target(399)).norm(), 0.011) << "a tenth of a second behind";
  EXPECT_NEAR(v.acceleration().x(), 0.1, 1e-6);
}

TEST(SmoothVelocity, WithoutAJerkLimitIsAPlainSlewWithNothingToFeedForward) {
  SmoothVelocity<1> v;
  const SmoothVelocity<1>::Limits limits{0.5, std::numeric_limits<double>::infinity()};
  v.update(Vec<1>(1.0), limits);
  EXPECT_DOUBLE_EQ(v.velocity()(0), 0.5 * kTickS);
  EXPECT_EQ(v.jerk()(0), 0.0);
  for (int k = 0; k < 500; ++k) v.update(Vec<1>(1.0), limits);
  EXPECT_NEAR(v.velocity()(0), 1.0, 1e-12);
}

TEST(SmoothVelocity, FeedsForwardTheChangeOfItsAccelerationAndForgetsAllOnReset) {
  SmoothVelocity<2> v;
  v.update(Vec2(0.3, -0.4), kLimits);
  EXPECT_NEAR(v.jerk().norm(), kLimits.jerk, 1e-9) << "from rest as fast as it may";
  EXPECT_NEAR(v.jerk().x() / v.jerk().y(), -0.75, 1e-12);
  EXPECT_NEAR((v.acceleration() - kTickS * v.jerk()).norm(), 0.0, 1e-15);
  EXPECT_NEAR((v.velocity() - kTickS * v.acceleration()).norm(), 0.0, 1e-15);
  v.reset();
  EXPECT_EQ(v.velocity(), Vec2(0.0, 0.0));
  EXPECT_EQ(v.acceleration(), Vec2(0.0, 0.0));
  EXPECT_EQ(v.jerk(), Vec2(0.0, 0.0));
  v.update(Vec2::Zero(), kLimits);
  EXPECT_EQ(v.velocity(), Vec2(0.0, 0.0)) << "nothing is missing";
}

/// The last bit of the way is closed within a tenth of a second, whatever the limits.
TEST(SmoothVelocity, ClosesTheLastBitLikeALowPass) {
  SmoothVelocity<1> v;
  v.update(Vec<1>(0.3), {100.0, 1000.0});
  EXPECT_NEAR(v.acceleration()(0), 10.0 * 0.3, 1e-12);
  SmoothVelocity<1> limited;
  limited.update(Vec<1>(0.3), {2.5, 1000.0});
  EXPECT_NEAR(limited.acceleration()(0), 2.5, 1e-12);
  SmoothVelocity<1> quick;  // no faster than it arrives
  quick.update(Vec<1>(0.003), {1.0, std::numeric_limits<double>::infinity()});
  EXPECT_NEAR(quick.velocity()(0), 0.003, 1e-15);
}

TEST(Chain, WithoutAnEntryNothingIsLate) {
  const Chain none;
  EXPECT_EQ(none.gyro_delay_s + none.accel_delay_s + none.attitude_delay_s + none.actuation_delay_s, 0.0);
}

TEST(DutyBudget, WithoutRoomForMotionThereIsNone) {
  DutyBudget b;
  EXPECT_GT(b.allowed_speed(100.0), 1e9) << "unlimited unless told otherwise";
  EXPECT_EQ(b.allowed_yaw_rate(-100.0), -100.0);
  b.share = 0.6;
  EXPECT_EQ(b.allowed_yaw_rate(-1e9), -1e9) << "who turns for nothing turns at will";
  EXPECT_GT(b.allowed_speed(1e9), 1e9);
  b.share = 0.1;
  b.of_friction = 0.2;
  b.per_yaw_rate = b.per_speed = 0.5;
  EXPECT_EQ(b.allowed_yaw_rate(3.0), 0.0);
  EXPECT_EQ(b.allowed_speed(0.0), 0.0);
}

TEST(DutyBudget, TurnsBeforeItTravels) {
  DutyBudget b;
  b.share = 0.6;
  b.of_friction = 0.1;
  b.per_yaw_rate = 0.02;
  b.per_speed = 0.5;
  EXPECT_DOUBLE_EQ(b.allowed_yaw_rate(10.0), 10.0);
  EXPECT_DOUBLE_EQ(b.allowed_yaw_rate(-40.0), -25.0);
  EXPECT_NEAR(b.allowed_speed(0.0), 1.0, 1e-12);
  EXPECT_NEAR(b.allowed_speed(-10.0), 0.6, 1e-12);
  EXPECT_EQ(b.allowed_speed(30.0), 0.0);
}

TEST(DutyBudget, OfTheMipKeepsItsWheelsBelowTheirRate) {
  const MipParameters p;
  const DutyBudget b = mip_duty_budget(p, {1.0, 18.0}, 0.8);
  const double to_wheel = p.d / 2.0;  // m/s of a wheel per rad/s of yaw
  for (const double yaw_rate : {0.0, 5.0, -10.0, 30.0}) {
    const double yaw = b.allowed_yaw_rate(yaw_rate);
    EXPECT_LE((b.allowed_speed(yaw) + to_wheel * std::abs(yaw)) / p.r, 18.0 + 1e-9) << yaw_rate;
  }
  EXPECT_NEAR(b.allowed_speed(10.0), 18.0 * p.r - 10.0 * to_wheel, 1e-9);
  EXPECT_NEAR(b.allowed_yaw_rate(30.0), 18.0 * p.r / to_wheel, 1e-9);
}

TEST(DutyBudget, WithoutBackEmfTheWheelsRateIsTheLimit) {
  MipParameters p;
  p.k2 = p.mu_v = p.mu_c = 0.0;
  const DutyBudget b = mip_duty_budget(p, {0.75, 18.0}, 0.8);
  EXPECT_NEAR(b.allowed_speed(0.0), 18.0 * p.r, 1e-6);
  EXPECT_NEAR(b.allowed_yaw_rate(1e3), 18.0 * p.r / (p.d / 2.0), 1e-5);
}

TEST(Allocate, KeepsBalanceAndGivesYawTheRest) {
  const Vec2 balance(0.7, 0.7);
  EXPECT_LT((within<2>(balance, Vec2(0.2, -0.2), 1.0) - Vec2(0.9, 0.5)).norm(), 1e-12);
  const Vec2 shared = within<2>(balance, Vec2(0.6, -0.6), 1.0);
  EXPECT_NEAR(shared.x(), 1.0, 1e-12);
  EXPECT_NEAR(shared.sum(), balance.sum(), 1e-12);  // balance untouched
  const Vec2 full = within<2>(Vec2(1.6, 0.8), Vec2(0.6, -0.6), 1.0);
  EXPECT_NEAR(full.x(), 1.0, 1e-12);
  EXPECT_NEAR(full.y(), 0.5, 1e-12);  // no yaw, the direction kept
}

TEST(Allocate, SharesWithinTheLimitWhateverTheSigns) {
  const double limit = 0.8;
  for (const Vec2& balance : {Vec2(0.3, -0.5), Vec2(-0.79, 0.2), Vec2(0.0, 0.0)}) {
    for (const Vec2& yaw : {Vec2(0.1, -0.1), Vec2(2.0, -2.0), Vec2(-2.0, 2.0), Vec2(-0.4, -3.0)}) {
      const Vec2 wheels = within<2>(balance, yaw, limit);
      EXPECT_LE(wheels.cwiseAbs().maxCoeff(), limit + 1e-12) << balance << yaw;
      const Vec2 added = wheels - balance;
      EXPECT_NEAR(added.x() * yaw.y(), added.y() * yaw.x(), 1e-12) << "all wheels the same share";
      EXPECT_GE(added.dot(yaw), 0.0);
      EXPECT_LE(added.norm(), yaw.norm() + 1e-12);
      const bool whole = (balance + yaw).cwiseAbs().maxCoeff() <= limit;
      EXPECT_NEAR(whole ? (added - yaw).norm() : wheels.cwiseAbs().maxCoeff() - limit, 0.0, 1e-12)
          << "all of it, or up to the limit";
    }
  }
  EXPECT_EQ(within<2>(Vec2(0.8, -0.4), Vec2(0.1, 0.1), limit), Vec2(0.8, -0.4)) << "no room left";
  EXPECT_EQ(within<2>(Vec2(0.8, -0.4), Vec2(-0.1, 0.1), limit), Vec2(0.8 - 0.1, -0.4 + 0.1))
      << "room the other way";
  const Vec2 shrunk = within<2>(Vec2(0.9, -0.3), Vec2(0.1, 0.1), 0.6);
  EXPECT_LT((shrunk - Vec2(0.6, -0.2)).norm(), 1e-12) << "below full duty, too";
  EXPECT_EQ(within<2>(Vec2::Zero(), Vec2::Zero(), 0.0), Vec2::Zero());
}

}  // namespace
}  // namespace equipoise
