#include "robots/mbbr/omniwheels.hpp"

#include <gtest/gtest.h>

#include "robots/mbbr/mbbr.hpp"

namespace equipoise {
namespace {

constexpr double kDegrees = kPi / 180.0;

TEST(Omniwheels, ClosedFormTiltAgreesWithTheTable) {
  // [T] Table 2.1, found there by iteration, is off by up to 0.04 deg.
  const double table[4][2] = {{45, 35.237}, {60, 48.186}, {70, 52.082}, {80, 54.145}};
  const double exact[4] = {35.2644, 48.1897, 52.0914, 54.1082};  // acos(1 / (sqrt(3) sin(alpha)))
  for (int i = 0; i < 4; ++i) {
    const double beta = orthogonal_beta_rad(table[i][0] * kDegrees) / kDegrees;
    EXPECT_NEAR(beta, exact[i], 1e-4);
    EXPECT_NEAR(beta, table[i][1], 0.04);
  }
}

TEST(Omniwheels, AxesAreOrthonormalAndThePrintedOnes) {
  const double alpha = 60.0 * kDegrees;
  const Mat3 T_ob = wheel_axes(alpha, orthogonal_beta_rad(alpha), -140.0 * kDegrees);
  EXPECT_LT((T_ob * T_ob.transpose() - Mat3::Identity()).norm(), 1e-12);
  Mat3 printed;  // (6.5), third row 0.5774 three times (0.5744 is a slip)
  printed << -0.7344, 0.0583, 0.6761, 0.3567, -0.8144, 0.4577, 0.5774, 0.5774, 0.5774;
  EXPECT_LT((T_ob - printed).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(Omniwheels, OrthogonalityNeedsEnoughLatitude) {
  EXPECT_TRUE(std::isnan(orthogonal_beta_rad(30.0 * kDegrees)));
}

TEST(MbbrKinematics, WheelsAndAxesAreInverse) {
  const MbbrKinematics k{MbbrParameters{}};
  const Vec3 u(0.3, -0.7, 0.2);
  EXPECT_LT((k.axes_from_wheels(k.wheels_from_axes(u)) - u).norm(), 1e-14);
  EXPECT_LT((k.ball_from_wheels(k.wheels_from_ball(u)) - u).norm(), 1e-14);
  EXPECT_LT((k.ball_from_wheels(k.wheels_of_turn(3.0)) - Vec3(0.0, 0.0, -3.0)).norm(), 1e-14);
  // |u| reaches r/r_w = 2.56 with all wheels at full duty, [T] (5.14)
  EXPECT_NEAR(k.axes_from_wheels(Vec3::Unit(0)).norm(), 0.032 / 0.0125, 1e-12);
}

// Plain omniwheels, axes along the meridian at 45 degrees (rob311, OpenBallBot-RL): not orthogonal.
TEST(MbbrKinematics, WheelsThatAreNotOrthogonalAreInverseToo) {
  MbbrParameters p;
  p.alpha_deg = 45.0;
  p.azimuth_deg = 0.0;
  p.wheel_tilt_deg = 0.0;
  const MbbrKinematics k(p);
  const Vec3 ball(0.3, -0.7, 0.2);
  EXPECT_TRUE(k.ball_from_wheels(k.wheels_from_ball(ball)).isApprox(ball, 1e-12));
  EXPECT_TRUE(k.axes_from_wheels(k.wheels_from_axes(ball)).isApprox(ball, 1e-12));
  // 3-D geometry: the ball turns about x; its surface at the contact of wheel 0 moves across that wheel's
  // axis.
  const Vec3 contact = p.r * Vec3(-std::sin(kPi / 4), 0.0, std::cos(kPi / 4));  // its axis rises along -x
  const Vec3 surface = Vec3::UnitX().cross(contact);
  const Vec3 axis(std::cos(kPi / 4), 0.0, std::sin(kPi / 4));
  const double along = surface.dot(axis.cross(contact.normalized()));
  EXPECT_NEAR(k.wheels_from_ball(Vec3::UnitX())(0), along / p.r_w, 1e-12);
  // What drives it equally about z turns it as fast as the axes' rise says, not as if they were orthogonal.
  EXPECT_NEAR(k.ball_from_wheels(Vec3::Ones()).z(), p.r_w / p.r / std::sin(kPi / 4), 1e-12);
}

TEST(MbbrKinematics, EulerAndBodyRatesAreInverse) {
  const Vec2 theta(0.3, -0.4);
  const Vec3 rates(1.0, -2.0, 5.0);
  EXPECT_LT((euler_rates(theta, body_rates(theta, rates)) - rates).norm(), 1e-13);
}

}  // namespace
}  // namespace equipoise
