#include "equipoise/control/riccati.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

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

TEST(Riccati, ScalarHasTheClosedForm) {
  // x = 2 x + u, q = r = 1: X = 4 X - 4 X^2/(1 + X) + 1.
  const CMatrix X =
      riccati(CMatrix::Constant(1, 1, 2.0), CMatrix::Ones(1, 1), CMatrix::Ones(1, 1), CMatrix::Ones(1, 1));
  EXPECT_NEAR(X(0, 0).real(), 2.0 + std::sqrt(5.0), 1e-13);
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
