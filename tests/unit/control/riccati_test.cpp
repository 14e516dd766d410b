#include "equipoise/control/riccati.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "equipoise/control/margins.hpp"

namespace equipoise {
namespace {

/// An unstable complex plant of three states.
struct Example {
  CMatrix A{
      {Complex(1.02, 0.01), 0.005, 0.0}, {0.1, Complex(0.98, -0.02), 0.02}, {0.0, 0.03, Complex(0.9, 0.1)}};
  CMatrix B{{Complex(0.001, 0.0)}, {Complex(-0.02, 0.003)}, {Complex(0.4, 0.0)}};
  CMatrix Q = CMatrix::Identity(3, 3) * 2.0;
  CMatrix R = CMatrix::Identity(1, 1) * 0.5;
};

TEST(Riccati, SolutionLeavesNoResidualAndStabilises) {
  const Example e;
  const CMatrix X = riccati(e.A, e.B, e.Q, e.R);
  const CMatrix BX = e.B.adjoint() * X;
  const CMatrix K = (e.R + BX * e.B).inverse() * BX * e.A;
  const CMatrix again = e.A.adjoint() * X * (e.A - e.B * K) + e.Q;
  EXPECT_LT((again - X).norm(), 1e-11 * X.norm());
  EXPECT_LT((e.A - e.B * K).eigenvalues().cwiseAbs().maxCoeff(), 1.0);
}

TEST(Riccati, ItsUnitIsThatOfTheCost) {
  const Example e;
  const CMatrix X = riccati(e.A, e.B, e.Q, e.R);
  for (const double unit : {1e-12, 1e12})
    EXPECT_LT((riccati(e.A, e.B, unit * e.Q, unit * e.R) / unit - X).norm(), 1e-11 * X.norm()) << unit;
}

TEST(Riccati, ScalarHasTheClosedForm) {
  // x = 2 x + u, q = r = 1: X = 4 X - 4 X^2/(1 + X) + 1.
  const CMatrix X =
      riccati(CMatrix::Constant(1, 1, 2.0), CMatrix::Ones(1, 1), CMatrix::Ones(1, 1), CMatrix::Ones(1, 1));
  EXPECT_NEAR(X(0, 0).real(), 2.0 + std::sqrt(5.0), 1e-13);
}

TEST(Riccati, WithoutAnInputIsTheCostOfWaiting) {
  // x = x/2, q = 1: X = X/4 + 1.
  const CMatrix one = CMatrix::Ones(1, 1);
  EXPECT_NEAR(riccati(0.5 * one, 0.0 * one, one, one)(0, 0).real(), 4.0 / 3.0, 1e-14);
}

TEST(Riccati, WhatNoInputReachesAndGrowsHasNoSolution) {
  const CMatrix one = CMatrix::Ones(1, 1);
  EXPECT_FALSE(riccati(2.0 * one, 0.0 * one, one, one).allFinite());
  CMatrix A = CMatrix::Zero(2, 2);
  A.diagonal() << 1.1, 0.5;
  CMatrix B = CMatrix::Zero(2, 1);
  B(1, 0) = 1.0;
  EXPECT_FALSE(riccati(A, B, CMatrix::Identity(2, 2), one).allFinite());
}

TEST(Hold, IsExactWhereTheMotionHasAClosedForm) {
  for (const double t : {0.005, 0.3, 40.0}) {
    const Hold falling = hold(CMatrix{{0.0, 1.0}, {0.0, 0.0}}, CMatrix{{0.0}, {2.0}}, t);
    EXPECT_LT((falling.A - CMatrix{{1.0, t}, {0.0, 1.0}}).norm(), 1e-13 * t + 1e-15) << t;
    EXPECT_LT((falling.B - CMatrix{{t * t}, {2.0 * t}}).norm(), 1e-13 * (t + t * t)) << t;
  }
  for (const double rate :
       {-0.499, -0.501, -1.0, -30.0, 3.0}) {  // decays and grows, with and without squarings
    const Hold decay = hold(CMatrix::Constant(1, 1, rate), CMatrix::Ones(1, 1), 1.0);
    EXPECT_NEAR(decay.A(0, 0).real() / std::exp(rate), 1.0, 1e-13) << rate;
    EXPECT_NEAR(decay.B(0, 0).real() / (std::expm1(rate) / rate), 1.0, 1e-13) << rate;
  }
  const Hold turn = hold(CMatrix::Constant(1, 1, Complex(0.0, 7.0)), CMatrix::Ones(1, 1), 0.5);
  EXPECT_LT(std::abs(turn.A(0, 0) - std::polar(1.0, 3.5)), 1e-14);
  EXPECT_LT(std::abs(turn.B(0, 0) - (std::polar(1.0, 3.5) - 1.0) / Complex(0.0, 7.0)), 1e-14);
}

TEST(Sampled, ALateInputOfAMovingPlantIsCarriedOn) {
  // x' = rate x + u: exp(rate period), and the two parts of the integral of exp(rate s).
  const double rate = 40.0;
  const SampledSystem s = sampled(CMatrix::Constant(1, 1, rate), CMatrix::Constant(1, 1, 3.0), 0.01, 0.004);
  EXPECT_NEAR(s.A(0, 0).real(), std::exp(rate * 0.01), 1e-14);
  EXPECT_NEAR(s.B(0, 0).real(), 3.0 * std::expm1(rate * 0.006) / rate, 1e-15);
  EXPECT_NEAR(s.B_late(0, 0).real(), 3.0 * (std::exp(rate * 0.01) - std::exp(rate * 0.006)) / rate, 1e-15);
}

TEST(Sampled, LateInputActsUnderTheOldValueFirst) {
  // x' = u: half of the period each.
  const SampledSystem s = sampled(CMatrix::Zero(1, 1), CMatrix::Ones(1, 1), 0.01, 0.004);
  EXPECT_NEAR(std::abs(s.B(0, 0) - 0.006), 0.0, 1e-15);
  EXPECT_NEAR(std::abs(s.B_late(0, 0) - 0.004), 0.0, 1e-15);
}

TEST(Lqr, GainOnTheInputBeforeStandsForTheDelay) {
  // A whole period of delay: the best gain acts on the state predicted by the input before.
  const CMatrix A{{1.0, 0.1}, {0.5, 1.0}};
  const CMatrix B{{0.005}, {0.1}};
  const SampledSystem prompt{A, B, CMatrix::Zero(2, 1)};
  const SampledSystem late{A, CMatrix::Zero(2, 1), B};
  const Eigen::Vector2d q(1.0, 1.0);
  const CMatrix K = lqr(prompt, q, Eigen::VectorXd::Ones(1));
  const CMatrix K_late = lqr(late, q, Eigen::VectorXd::Ones(1));
  EXPECT_EQ(K(0, 2), 0.0);
  EXPECT_LT((K_late.leftCols(2) - K.leftCols(2) * A).norm(), 1e-12);
  EXPECT_LT(std::abs(K_late(0, 2) - (K.leftCols(2) * B)(0, 0)), 1e-12);
  EXPECT_LT(largest_pole(late, K_late), 1.0);
  EXPECT_GT(largest_pole(prompt, CMatrix::Zero(1, 3)), 1.0);
}

TEST(Lqr, WeighsEveryStateAndEveryInputByItsOwn) {
  // Two integrators beside each other, x = x + u: X^2 - q X - q r = 0 and K = X/(r + X), each with its
  // weights.
  const SampledSystem beside{CMatrix::Identity(2, 2), CMatrix::Identity(2, 2), CMatrix::Zero(2, 2)};
  const Eigen::Vector2d q(1.0, 9.0);
  const Eigen::Vector2d r(4.0, 0.25);
  const CMatrix K = lqr(beside, q, r);
  for (int i = 0; i < 2; ++i) {
    const double X = 0.5 * (q(i) + std::sqrt(q(i) * q(i) + 4.0 * q(i) * r(i)));
    EXPECT_NEAR(K(i, i).real(), X / (r(i) + X), 1e-13);
    EXPECT_NEAR(std::abs(K(i, 1 - i)), 0.0, 1e-13);
  }
  const double slowest = std::max(1.0 - K(0, 0).real(), 1.0 - K(1, 1).real());
  EXPECT_NEAR(largest_pole(beside, K), slowest, 1e-12);
  EXPECT_EQ(closed_loop_poles(beside, K).size(), 4) << "two states and two inputs before";
  EXPECT_TRUE(std::isinf(largest_pole(beside, CMatrix::Constant(2, 4, std::nan("")))));
}

TEST(Margins, OfAnIntegratorWithDelay) {
  // L = a/(i w) e^(-i w d): crossing at w = a, phase pi/2 - a d, delay (pi/2)/a - d, gain (pi/2)/(a d).
  const double a = 10.0;
  const double d = 0.02;
  const std::vector<double> w = frequency_grid(0.005, 2000, 0.0);
  std::vector<std::complex<double>> L;
  L.reserve(w.size());
  for (const double at : w) L.push_back(a / std::complex<double>(0.0, at) * std::polar(1.0, -at * d));
  const Margins m = margins(w, L, 0.0);
  EXPECT_NEAR(m.phase_deg, (0.5 * 3.14159265 - a * d) * 180.0 / 3.14159265, 0.01);
  EXPECT_NEAR(m.delay_s, 0.5 * 3.14159265 / a - d, 1e-5);
  EXPECT_NEAR(m.gain_up_dB, 20.0 * std::log10(0.5 * 3.14159265 / (a * d)), 0.01);
  EXPECT_TRUE(std::isinf(m.gain_down_dB));
}

TEST(Margins, OfAComplexLoopLookAtBothSigns) {
  // The integrator turned by 40 degrees: 50 left on one side.
  const std::vector<double> w = frequency_grid(0.005, 2000, 0.0);
  std::vector<std::complex<double>> L;
  L.reserve(w.size());
  for (const double at : w)
    L.push_back(10.0 / std::complex<double>(0.0, at) * std::polar(1.0, 40.0 / 57.29578));
  EXPECT_NEAR(margins(w, L, 0.0).phase_deg, 50.0, 0.01);
}

}  // namespace
}  // namespace equipoise
