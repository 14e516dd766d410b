// Robots that no motor balances are refused with the parameter that says so; pendulums and integrators, whose
// limits are known in closed form.
#include "equipoise/control/plausible.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {
namespace {

/// theta'' = rate^2 theta + push u.
CMatrix pendulum(double rate_1_s) { return CMatrix{{0.0, 1.0}, {rate_1_s * rate_1_s, 0.0}}; }
CMatrix push(double acceleration) { return CMatrix{{0.0}, {acceleration}}; }

TEST(Recoverable, OfAPendulumIsWhereTheMotorJustHoldsIt) {
  const Recoverable r = recoverable(pendulum(5.0), push(-2.0), 0);
  EXPECT_NEAR(r.pole_rad_s, 5.0, 1e-12);
  EXPECT_NEAR(r.limit, 2.0 / 25.0, 1e-12);
  EXPECT_NEAR(recoverable(pendulum(5.0), push(-2.0), 1).limit, 2.0 / 5.0, 1e-12) << "of the rate alone";
}

TEST(BeyondRecovery, NamesMotorsThatAreTooWeakAndFallsThatAreTooFast) {
  EXPECT_FALSE(beyond_recovery(pendulum(5.0), push(0.041 * 25.0), 0));
  auto problem = beyond_recovery(pendulum(5.0), push(0.039 * 25.0), 0);
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->parameter, "com_height_m, body_mass_kg or k1_N_m");
  EXPECT_NE(problem->why.find("0.039"), std::string::npos) << problem->why;
  EXPECT_FALSE(beyond_recovery(pendulum(24.9), push(100.0), 0));
  EXPECT_FALSE(beyond_recovery(pendulum(0.5), push(1.0), 0)) << "it may fall as slowly as it likes";
  problem = beyond_recovery(pendulum(25.1), push(100.0), 0);
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->parameter, "com_height_m");
  problem = beyond_recovery(pendulum(1.0), push(101.0), 0);
  ASSERT_TRUE(problem) << "a tilt of a hundred radians is a mistake";
}

TEST(Outside, TheLimitsAreAllowedAndTheTextNamesThem) {
  EXPECT_FALSE(outside("key", "size", 1.0, 1.0, 2.0));
  EXPECT_FALSE(outside("key", "size", 2.0, 1.0, 2.0));
  EXPECT_TRUE(outside("key", "size", 0.999, 1.0, 2.0));
  EXPECT_TRUE(outside("key", "size", std::nan(""), 1.0, 2.0));
  const auto problem = outside("key", "size", 2.5, 1.0, 2.0);
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->parameter, "key");
  EXPECT_EQ(problem->why, "implausible: size is 2.500000; allowed: 1.000000 to 2.000000");
}

/// x' = u, sampled; the gain that crosses 1 at `turn` radians a tick, turned by `phase_deg`. Its phase margin
/// is 90 degrees less half of `turn` and `phase_deg`, its delay margin that over the crossing.
std::optional<DesignProblem> integrator(double turn, double phase_deg) {
  const SampledSystem loop{CMatrix::Ones(1, 1), CMatrix::Constant(1, 1, kTickS), CMatrix::Zero(1, 1)};
  CMatrix K = CMatrix::Zero(1, 2);
  K(0, 0) = std::polar(2.0 * std::sin(0.5 * turn) / kTickS, phase_deg * std::acos(-1.0) / 180.0);
  return without_margin(loop, K);
}

TEST(WithoutMargin, TheDelayMustBeFourFifthsOfATick) {
  // pi/2 - turn/2 = 0.8 turn: 1.208
  EXPECT_FALSE(integrator(1.17, 0.0));
  const auto problem = integrator(1.25, 0.0);
  ASSERT_TRUE(problem);
  EXPECT_NE(problem->why.find("delay margin"), std::string::npos) << problem->why;
  EXPECT_EQ(problem->parameter, "");
}

TEST(WithoutMargin, ThePhaseMustBeThirtyDegrees) {
  // 90 - 2.9 degrees of it without a turn
  EXPECT_FALSE(integrator(0.1, -56.0));
  EXPECT_FALSE(integrator(0.1, 56.0));
  for (const double phase_deg : {-58.5, 62.0}) {
    const auto problem = integrator(0.1, phase_deg);
    ASSERT_TRUE(problem) << phase_deg;
    EXPECT_NE(problem->why.find("phase margin"), std::string::npos) << problem->why;
  }
  EXPECT_TRUE(integrator(kTickS, -62.0)) << "where the loop crosses at 1 rad/s, too";
}

TEST(WithoutMargin, AGainOnTheInputBeforeIsPartOfTheLoop) {
  const SampledSystem late{CMatrix::Ones(1, 1), CMatrix::Zero(1, 1), CMatrix::Constant(1, 1, kTickS)};
  CMatrix K{{0.75 / kTickS, 0.0}};
  EXPECT_TRUE(without_margin(late, K)) << "a whole tick is gone already";
  K(0, 1) = 0.75;  // foresees what the late input does
  EXPECT_FALSE(without_margin(late, K));
}

/// At a radian a tick 90 - 29 degrees of the integrator and 12 of 1 / (1 + 0.3 / z), less 25.
TEST(WithoutMargin, AGainOnTheInputBeforeLeads) {
  const SampledSystem loop{CMatrix::Ones(1, 1), CMatrix::Constant(1, 1, kTickS), CMatrix::Zero(1, 1)};
  CMatrix K = CMatrix::Constant(1, 2, 0.3);
  K(0, 0) = std::polar(1.189 * 2.0 * std::sin(0.5) / kTickS, -25.0 * std::acos(-1.0) / 180.0);
  EXPECT_FALSE(without_margin(loop, K));
}

TEST(WithoutMargin, WhatIsNotStableHasNone) {
  const auto problem = integrator(3.0, 80.0);
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->why, "no gain stabilises this robot");
  const SampledSystem loop{CMatrix::Ones(1, 1), CMatrix::Constant(1, 1, kTickS), CMatrix::Zero(1, 1)};
  const auto gain = [](Complex) { return CMatrix{{1.0, 0.0}}; };
  EXPECT_FALSE(without_margin(loop, 0.999, gain));
  EXPECT_TRUE(without_margin(loop, 1.0, gain)) << "nor what neither grows nor decays";
}

TEST(TooFastForTheTick, IsAModeBeyondOnePerTick) {
  const auto decaying = [](double rate_1_s) { return CMatrix{{-rate_1_s, 1.0}, {0.0, -1.0}}; };
  EXPECT_FALSE(too_fast_for_the_tick("key", decaying(199.0)));
  EXPECT_FALSE(too_fast_for_the_tick("key", CMatrix::Constant(1, 1, -0.5))) << "no mode is too slow";
  const auto problem = too_fast_for_the_tick("key", decaying(201.0));
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->parameter, "key");
}

}  // namespace
}  // namespace equipoise
