// Coefficients from physics.md section 2 (derived) and [T] (3.38)-(3.47) (printed); Jacobians by differences.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "robots/mip/config.hpp"
#include "robots/mip/ekf.hpp"
#include "robots/mip/published.hpp"

namespace equipoise {
namespace {

using M = MipEkfModel;

M model(bool lever_arm) {
  MipParameters p;
  p.l_a = Vec3(0.0, 0.016, p.l);
  return {p, {true, true, lever_arm, lever_arm}, 1.0};
}

TEST(MipEkfModel, HasTheDerivedCoefficients) {
  M::Motion x = M::Motion::Zero();
  M::Motion x_dot;
  Mat<6, 6> A;
  model(false).derivative(x, Vec2::Zero(), x_dot, A);
  EXPECT_NEAR(kTickS * A(M::kThetaDot, M::kTheta), 0.629, 1e-3);
  EXPECT_NEAR(kTickS * A(M::kThetaDot, M::kPhiDot), 0.0681, 1e-4);
  EXPECT_NEAR(1.0 + kTickS * A(M::kPhiDot, M::kPhiDot), 0.813, 1e-3);
  EXPECT_NEAR(kTickS * A(M::kPhiDot, M::kTheta), -1.115, 1e-3);
  EXPECT_NEAR(1.0 + kTickS * A(M::kPsiDot, M::kPsiDot), 0.939, 1e-3);
  model(false).derivative(x, Vec2(1.0, 1.0), x_dot, A);
  EXPECT_NEAR(kTickS * x_dot(M::kThetaDot), -2.72, 1e-2);
  EXPECT_NEAR(kTickS * x_dot(M::kPhiDot), 7.47, 1e-2);
  EXPECT_NEAR(kTickS * x_dot(M::kPsiDot), 2.43, 1e-2);
  Mat<6, 6> turning;
  x(M::kPsiDot) = 10.0;
  model(false).derivative(x, Vec2::Zero(), x_dot, turning);
  EXPECT_NEAR(kTickS * (turning - A)(M::kThetaDot, M::kTheta), 0.127, 1e-3);
  EXPECT_NEAR(kTickS * (turning - A)(M::kPhiDot, M::kTheta), 0.162, 1e-3);
}

TEST(MipEkfModel, JacobiansAgreeWithDifferences) {
  const M m = model(true);
  Vec<14> x;
  x << 0.1, 0.5, 0.3, -0.4, 3.0, 8.0, 0.02, -0.03, 0.025, 0.01, 0.004, 0.03, 0.0, 0.0;
  const Vec2 u(0.3, -0.2);
  Vec<14> f0;
  Mat<14, 14> F;
  m.predict(x, u, f0, F);
  Vec<6> h0;
  Mat<6, 14> H;
  m.measure(x, u, h0, H);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < M::kDisturbance; ++i) {  // F takes the disturbance as it acts upright
    Vec<14> up = x;
    Vec<14> down = x;
    up(i) += kStep;
    down(i) -= kStep;
    Vec<14> f_up, f_down;
    Mat<14, 14> ignored_F;
    m.predict(up, u, f_up, ignored_F);
    m.predict(down, u, f_down, ignored_F);
    EXPECT_LT(((f_up - f_down) / (2 * kStep) - F.col(i)).norm(), 1e-6) << "state " << i;
    Vec<6> h_up, h_down;
    Mat<6, 14> ignored_H;
    m.measure(up, u, h_up, ignored_H);
    m.measure(down, u, h_down, ignored_H);
    EXPECT_LT(((h_up - h_down) / (2 * kStep) - H.col(i)).norm(), 1e-6) << "state " << i;
  }
}

TEST(MipEkfModel, SeesTheCentripetalAccelerationOfItsLeverArm) {
  Vec<14> x = Vec<14>::Zero();
  x(M::kPsiDot) = 10.0;
  Vec<6> y;
  Mat<6, 14> H;
  model(true).measure(x, Vec2::Zero(), y, H);
  EXPECT_NEAR(y(M::kAccelY), 1.6, 1e-9);  // gravity minus acceleration: 0.016 m x 100 /s^2
  model(false).measure(x, Vec2::Zero(), y, H);
  EXPECT_NEAR(y(M::kAccelY), 0.0, 1e-12);
}

/// A robot that stands upright and begins to turn, seen by a misaligned IMU; the wheels turn by
/// `wheel_scale` more than track and radius say.
MipEkf turned(const MipConfig& config, const Vec3& mount, double wheel_scale) {
  const Mat3 R_mount = Eigen::AngleAxisd(mount.norm(), mount.normalized()).toRotationMatrix();
  const double held = (config.robot.k2 + config.robot.mu_v) / config.robot.k1 * config.robot.yaw_to_wheel();
  MipEkf filter(config.robot, config.estimators.ekf);
  double rate_rad_s = 0.0;
  double psi = 0.0;
  for (int k = 0; k < 6000; ++k) {
    rate_rad_s = std::min(8.0, rate_rad_s + 0.8 * kTickS);
    psi += rate_rad_s * kTickS;
    const Vec3 accel(0.0, rate_rad_s * rate_rad_s * config.robot.l_a.y(), -kGravity_m_s2);
    Mip::Sample z;
    z.gyro_B_rad_s = R_mount.transpose() * Vec3(0.0, 0.0, rate_rad_s);
    z.accel_B_m_s2 = R_mount.transpose() * accel;
    z.wheel_angle_rad = MipKinematics(config.robot).wheels(0.0, (1.0 + wheel_scale) * psi);
    z.imu_ok = z.encoders_ok = true;
    filter.predict(Vec2(0.0, held * rate_rad_s));  // what holds the rate against back-EMF and friction
    filter.update(z);
  }
  return filter;
}

TEST(MipEkf, FindsACrookedMountWhileTurning) {
  const MipConfig config = load_mip(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml", {}).config;
  const Vec3 mount(0.03, -0.02, 0.0);
  const MipEkf filter = turned(config, mount, 0.0);
  EXPECT_LT((filter.x().segment<2>(M::kMountX) - mount.head<2>()).norm(), 0.003);
  EXPECT_NEAR(filter.estimate().theta, 0.0, 0.003);
  EXPECT_NEAR(filter.estimate().psi_dot, 8.0, 0.01);
}

/// Of axle and body by hand: both move with the axle, the body leans about it.
TEST(MipEkf, APushAtTheCentreOfMassMovesBodyAndWheelsTogether) {
  const MipParameters p;
  MipEkf::Params params;
  params.filter.initial_variance.setConstant(1e-8);
  MipEkf ekf(p, params);
  const auto before = ekf.P();
  ekf.allow_push(2.0);
  const auto added = Mat<14, 14>(ekf.P() - before);
  Mat<2, 2> inertia;
  inertia << p.m_b + 2.0 * (p.m_w + p.I_w1 / (p.r * p.r)), p.m_b * p.l, p.m_b * p.l,
      p.I_b1 + p.m_b * p.l * p.l;
  const Vec2 rates = inertia.inverse() * (2.0 * kTickS * Vec2(1.0, p.l));
  const double lean = rates.y();
  const double wheel = rates.x() / p.r - lean;
  EXPECT_NEAR(added(MipEkfModel::kThetaDot, MipEkfModel::kThetaDot), lean * lean, 1e-3 * lean * lean);
  EXPECT_NEAR(added(MipEkfModel::kPhiDot, MipEkfModel::kPhiDot), wheel * wheel, 1e-3 * wheel * wheel);
  EXPECT_NEAR(added(MipEkfModel::kThetaDot, MipEkfModel::kPhiDot), lean * wheel,
              1e-3 * std::abs(lean * wheel));
}

TEST(MipEkf, FindsATrackUnlikeTheConfiguredOne) {
  const MipConfig config = load_mip(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml", {}).config;
  const Vec3 mount(0.03, -0.02, 0.0);
  const MipEkf filter = turned(config, mount, 0.03);
  EXPECT_NEAR(filter.x()(M::kWheelScale), 0.03, 0.001);
  EXPECT_LT((filter.x().segment<2>(M::kMountX) - mount.head<2>()).norm(), 0.003);
  EXPECT_NEAR(filter.estimate().theta, 0.0, 0.003);
  EXPECT_NEAR(filter.estimate().psi_dot, 8.0, 0.01);
  // 10 s to gain speed, 20 s at 8 rad/s: the heading is the gyro's, not the encoders'.
  EXPECT_NEAR(filter.estimate().psi, 0.5 * 8.0 * 10.0 + 8.0 * 20.0, 0.3);
  EXPECT_LT(filter.estimate().normalized_innovation, 0.5);
}

/// Nodding shows a mount that is turned about the vertical: the lean's rate appears on the gyro's y axis,
/// where a filter without that angle takes it for a turn.
TEST(MipEkfModel, SeesTheLeansRateAcrossAMountTurnedAboutTheVertical) {
  Vec<14> x = Vec<14>::Zero();
  x(M::kThetaDot) = 1.5;
  x(M::kMountZ) = 0.03;
  Vec<6> y;
  Mat<6, 14> H;
  model(true).measure(x, Vec2::Zero(), y, H);
  const Vec3 seen =
      Eigen::AngleAxisd(0.03, Vec3::UnitZ()).toRotationMatrix().transpose() * Vec3(1.5, 0.0, 0.0);
  EXPECT_NEAR(y(M::kGyro + 1), seen.y(), 1e-4);
  EXPECT_NEAR(y(M::kGyro + 1), -0.045, 1e-4);
  EXPECT_NEAR(y(M::kGyro + 2), 0.0, 1e-12);
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
