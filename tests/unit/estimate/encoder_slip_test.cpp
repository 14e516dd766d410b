#include <gtest/gtest.h>

#include <algorithm>

#include "robots/mbbr/config.hpp"
#include "robots/mbbr/ekf.hpp"
#include "robots/mip/config.hpp"
#include "robots/mip/ekf.hpp"

namespace equipoise {
namespace {

std::string configuration(const char* robot) {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/config/" + robot + ".toml";
}

template <class Sample>
Sample at_rest() {
  Sample z;
  z.gyro_B_rad_s.setZero();
  z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
  z.wheel_angle_rad.setZero();
  z.imu_ok = z.encoders_ok = true;
  return z;
}

/// The robot stands; the IMU says so. Half a second without, a tenth with slip, half a second after it.
TEST(EncoderSlip, AWheelThatSlipsMovesNoBall) {
  const MbbrConfig config = load_mbbr(configuration("mbbr"), {}).config;
  const MbbrParameters& p = config.robot;
  constexpr double kNoLoad_rad_s = 108.0;  // [T] section 6.2.3, at 8 V
  // What a contact with a grip of 1 may do to a ball alone in a tick; its load: [T] (2.2).
  const double load_N = p.m_t * kGravity_m_s2 / (3.0 * std::cos(p.alpha_deg * kPi / 180.0));
  const double most_rad_s = kTickS * load_N * p.r / (p.I_b + p.m_b * p.r * p.r);
  for (int wheel = 0; wheel < 3; ++wheel) {
    MbbrEkf filter(p, config.estimators.ekf);
    filter.start(Vec2::Zero(), Vec3::Zero(), Vec3::Zero());
    auto z = at_rest<Mbbr::Sample>();
    for (int k = 1; k <= 220; ++k) {
      if (k > 100 && k <= 120) z.wheel_angle_rad(wheel) += kTickS * kNoLoad_rad_s;
      filter.predict(Vec3::Zero());
      filter.update(z);
      const MbbrEstimate x = filter.estimate();
      ASSERT_LT(x.phi_dot_star.norm(), most_rad_s) << wheel << " " << k;
      ASSERT_LT(x.theta_xy.norm(), 0.01) << wheel << " " << k;
    }
    EXPECT_LT(filter.estimate().phi_dot_star.norm(), 0.1 * most_rad_s) << wheel;
  }
}

/// Most that the ball turns, as the filter has it, while a wheel spins so for a tenth of a second.
double most_ball_rate_rad_s(double wheel_rad_s) {
  const MbbrConfig config = load_mbbr(configuration("mbbr"), {}).config;
  MbbrEkf filter(config.robot, config.estimators.ekf);
  filter.start(Vec2::Zero(), Vec3::Zero(), Vec3::Zero());
  auto z = at_rest<Mbbr::Sample>();
  double most = 0.0;
  for (int k = 1; k <= 120; ++k) {
    if (k > 100) z.wheel_angle_rad(0) += kTickS * wheel_rad_s;
    filter.predict(Vec3::Zero());
    filter.update(z);
    most = std::max(most, filter.estimate().phi_dot_star.norm());
  }
  return most;
}

TEST(EncoderSlip, AnMbbrFollowsAWheelTheLessTheFasterItSpins) {
  EXPECT_LT(most_ball_rate_rad_s(100.0), 0.5 * most_ball_rate_rad_s(25.0));
}

/// The ball rolls; an encoder dies. Were it a slip, the filter would shift its count tick by tick.
TEST(EncoderSlip, AWheelThatStandsStillDoesNotSlip) {
  const MbbrConfig config = load_mbbr(configuration("mbbr"), {}).config;
  const MbbrKinematics kinematics(config.robot);
  const Vec3 wheels_rad_s = kinematics.wheels_from_ball(Vec3(3.0, 0.0, 0.0));
  MbbrEkf filter(config.robot, config.estimators.ekf);
  auto z = at_rest<Mbbr::Sample>();
  z.wheel_rate_rad_s = wheels_rad_s;
  filter.start_moving(Vec2::Zero(), Vec3::Zero(), z);
  int wheel = 0;
  wheels_rad_s.cwiseAbs().maxCoeff(&wheel);
  double most = 0.0;
  for (int k = 1; k <= 120; ++k) {
    const double stands_rad = z.wheel_angle_rad(wheel);
    z.wheel_angle_rad += kTickS * wheels_rad_s;
    if (k > 100) z.wheel_angle_rad(wheel) = stands_rad;
    filter.predict(Vec3::Zero());
    filter.update(z);
    if (k > 100) most = std::max(most, filter.row_nis()[static_cast<std::size_t>(3 + wheel)]);
  }
  EXPECT_GT(most, 9.0);
}

TEST(EncoderSlip, AMotorInItsBacklashMovesNoWheel) {
  const MipConfig config = load_mip(configuration("edumip"), {}).config;
  const MipParameters& p = config.robot;
  constexpr double kBacklash_rad = 0.087;  // 5 degrees: a worn 35:1 gear
  // What a motor may do to its wheel with half of the body in a tick.
  const double most_rad_s = kTickS * p.k1 / (p.I_w1 + (p.m_w + 0.5 * p.m_b) * p.r * p.r);
  for (const double other : {0.0, 1.0}) {
    MipEkf filter(p, config.estimators.ekf);
    filter.start(0.0, Vec3::Zero(), Vec2::Zero());
    auto z = at_rest<Mip::Sample>();
    for (int k = 1; k <= 200; ++k) {
      if (k % 20 == 0) {
        const double across = k % 40 == 0 ? -kBacklash_rad : kBacklash_rad;
        z.wheel_angle_rad += across * Vec2(1.0, other);
      }
      filter.predict(Vec2::Zero());
      filter.update(z);
      ASSERT_LT(std::abs(filter.estimate().phi_dot), most_rad_s) << other << " " << k;
      ASSERT_LT(std::abs(filter.estimate().theta), 0.01) << other << " " << k;
    }
  }
}

}  // namespace
}  // namespace equipoise
