// Coefficients from physics.md section 2 (derived) and [T] (3.38)-(3.47) (printed); Jacobians by differences.
#include <gtest/gtest.h>

#include "robots/mip/models.hpp"
#include "robots/mip/published.hpp"

namespace equipoise {
namespace {

using M = MipHighYawModel;

MipHighYawModel model(bool lever_arm) {
  MipParameters p;
  p.l_a = Vec3(0.0, 0.016, p.l);
  return {p, {true, lever_arm, lever_arm}};
}

TEST(MipHighYawModel, HasTheDerivedCoefficients) {
  Vec<8> x = Vec<8>::Zero();
  x(M::kTheta) = 1.0;
  Vec<8> next;
  Mat<8, 8> F;
  model(false).predict(Vec<8>::Zero(), Vec2::Zero(), next, F);
  EXPECT_NEAR(F(M::kThetaDot, M::kTheta), 0.629, 1e-3);
  EXPECT_NEAR(F(M::kThetaDot, M::kPhiDot), 0.0681, 1e-4);
  EXPECT_NEAR(F(M::kPhiDot, M::kPhiDot), 0.813, 1e-3);
  EXPECT_NEAR(F(M::kPhiDot, M::kTheta), -1.115, 1e-3);
  EXPECT_NEAR(F(M::kPsiDot, M::kPsiDot), 0.939, 1e-3);
  const Mat<8, 2> B = model(false).input_matrix();
  EXPECT_NEAR(B(M::kThetaDot, 0), -2.72, 1e-2);
  EXPECT_NEAR(B(M::kPhiDot, 0), 7.47, 1e-2);
  EXPECT_NEAR(B(M::kPsiDot, 1), 2.43, 1e-2);
  x(M::kPsiDot) = 1.0;
  model(false).predict(x, Vec2::Zero(), next, F);
  EXPECT_NEAR(F(M::kThetaDot, M::kTheta) - 0.629, 0.0030, 1e-3);
  EXPECT_NEAR(F(M::kPhiDot, M::kTheta) + 1.115, -0.0053, 1e-3);
}

TEST(MipHighYawModel, JacobiansAgreeWithDifferences) {
  const MipHighYawModel m = model(true);
  Vec<8> x;
  x << 0.1, 0.5, 0.3, -0.4, 3.0, 8.0, 0.01, 0.004;
  const Vec2 u(0.3, -0.2);
  Vec<8> f0;
  Mat<8, 8> F;
  m.predict(x, u, f0, F);
  Vec<6> h0;
  Mat<6, 8> H;
  m.measure(x, u, h0, H);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 8; ++i) {
    Vec<8> up = x;
    Vec<8> down = x;
    up(i) += kStep;
    down(i) -= kStep;
    Vec<8> f_up, f_down;
    Mat<8, 8> ignored_F;
    m.predict(up, u, f_up, ignored_F);
    m.predict(down, u, f_down, ignored_F);
    EXPECT_LT(((f_up - f_down) / (2 * kStep) - F.col(i)).norm(), 1e-6) << "state " << i;
    Vec<6> h_up, h_down;
    Mat<6, 8> ignored_H;
    m.measure(up, u, h_up, ignored_H);
    m.measure(down, u, h_down, ignored_H);
    EXPECT_LT(((h_up - h_down) / (2 * kStep) - H.col(i)).norm(), 1e-6) << "state " << i;
  }
}

TEST(MipHighYawModel, SeesTheCentripetalAccelerationOfItsLeverArm) {
  Vec<8> x = Vec<8>::Zero();
  x(M::kPsiDot) = 10.0;
  Vec<6> y;
  Mat<6, 8> H;
  model(true).measure(x, Vec2::Zero(), y, H);
  EXPECT_NEAR(y(M::kAccelY), 1.6, 1e-9);  // gravity minus acceleration: 0.016 m x 100 /s^2
  model(false).measure(x, Vec2::Zero(), y, H);
  EXPECT_NEAR(y(M::kAccelY), 0.0, 1e-12);
}

TEST(MipPublishedModel, IsAsPrinted) {
  Vec<6> x;
  x << 0.1, 0.2, 0.3, 0.4, 0.5, 2.0;
  const Vec2 u(0.6, 0.7);
  Vec<6> next;
  Mat<6, 6> F;
  MipPublishedModel{}.predict(x, u, next, F);
  EXPECT_NEAR(next(3), 0.4 + 0.0629 + 0.034 + 0.0036 - 1.632, 1e-12);  // (3.41)
  EXPECT_NEAR(next(4), 0.4065 - 0.112 - 0.0064 + 4.482, 1e-12);        // (3.42)
  EXPECT_NEAR(next(5), 1.878 + 1.708, 1e-12);                          // (3.43)
  Vec<4> y;
  Mat<4, 6> H;
  MipPublishedModel{}.measure(x, u, y, H);
  EXPECT_NEAR(y(2), 4.902 - 0.741 - 0.102 - 0.01384, 1e-12);  // (3.47)
}

}  // namespace
}  // namespace equipoise
