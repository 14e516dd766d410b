// The closed form of a linear system, and differences: what the discretisation has to agree with.
#include "equipoise/estimate/heun.hpp"

#include <gtest/gtest.h>

#include <complex>

namespace equipoise {
namespace {

/// phi*' of a robot that turns and drives: back-EMF, transport, constant input. x' = a x + b.
TEST(Heun, KeepsABallRateThatTurnsAgainstBackEmf) {
  using Complex = std::complex<double>;
  const Complex a(-43.0, -6.0 * kPi);  // 3 Hz
  const Complex b = 43.0 * 6.25;       // holds 0.2 m/s
  const Complex x(6.25, 0.0);
  const auto derivative = [&](const Vec2& at, Vec2& x_dot, Mat<2, 2>& A) {
    const Complex f = a * Complex(at.x(), at.y()) + b;
    x_dot << f.real(), f.imag();
    A << a.real(), -a.imag(), a.imag(), a.real();
  };
  Vec2 next;
  Mat<2, 2> F;
  heun<2>(derivative, Vec2(x.real(), x.imag()), kTickS, next, F);
  const Complex turned = std::exp(a * kTickS);
  const Complex exact = turned * x + (turned - 1.0) / a * b;
  // 0.1 rad/s^2 tilt the estimate by 0.0005 rad; the midpoint rule errs by 1.1 rad/s^2 here.
  EXPECT_LT(std::abs(Complex(next.x(), next.y()) - exact) / kTickS, 0.1);
  EXPECT_NEAR(F(0, 0), turned.real(), 2e-4);
  EXPECT_NEAR(F(1, 0), turned.imag(), 2e-4);
}

TEST(Heun, JacobianIsTheDerivativeOfTheStep) {
  const auto derivative = [](const Vec2& x, Vec2& x_dot, Mat<2, 2>& A) {
    x_dot << x.x() * x.y(), std::sin(x.x()) - 3.0 * x.y();
    A << x.y(), x.x(), std::cos(x.x()), -3.0;
  };
  const auto slope = [&](const Vec2& x) {
    Vec2 x_dot;
    Mat<2, 2> A;
    derivative(x, x_dot, A);
    return x_dot;
  };
  const Vec2 x(0.7, -1.3);
  Vec2 next;
  Mat<2, 2> F;
  heun<2>(derivative, x, 0.1, next, F);
  EXPECT_LT((next - heun<2>(slope, x, 0.1)).norm(), 1e-15);
  constexpr double h = 1e-6;
  for (int i = 0; i < 2; ++i) {
    const Vec2 d = h * Vec2::Unit(i);
    EXPECT_LT(((heun<2>(slope, x + d, 0.1) - heun<2>(slope, x - d, 0.1)) / (2.0 * h) - F.col(i)).norm(),
              1e-9);
  }
}

}  // namespace
}  // namespace equipoise
