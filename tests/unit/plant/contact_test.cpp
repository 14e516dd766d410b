// What contacts carry: the ball on the floor, the wheels on the ball; and what else a built robot has.
#include <gtest/gtest.h>

#include "robots/mbbr/world.hpp"
#include "robots/mip/world.hpp"

namespace equipoise {
namespace {

MbbrWorldParams quiet() {
  MbbrWorldParams w;
  w.common.initial_tilt_rad = 0.0;
  return w;
}

class World {
 public:
  explicit World(const MbbrWorldParams& params)
      : world_(MbbrParameters(), MotorParameters(), Calibration(), params) {}
  World& run(const std::array<double, 3>& duty, int ticks) {
    MotorCommand command{};
    command.enable = true;
    for (std::size_t i = 0; i < duty.size(); ++i) command.duty[i] = duty[i];
    for (int i = 0; i < ticks; ++i) {
      world_.advance(command);
      raw_ = world_.sense();
      slipped_ = slipped_ || world_.slipping();
    }
    return *this;
  }
  MbbrEstimate truth() const { return world_.truth(); }
  const RawSample& raw() const { return raw_; }
  bool slipped() const { return slipped_; }
  Vec2 position_m() const { return ball_velocity(MbbrParameters().r, world_.truth().phi); }

 private:
  MbbrWorld world_;
  RawSample raw_{};
  bool slipped_ = false;
};

constexpr std::array<double, 3> kSpin{0.9, 0.9, 0.9};
constexpr std::array<double, 3> kTip{0.95, -0.8, 0.7};

TEST(SlippingBall, HeldByTheFloorItRollsAsTheRollingModelSays) {
  // The eight velocities under exactly the force that rolling needs: the two derivations agree.
  const MbbrParameters p;
  const MbbrDynamics rolling{p};
  const MbbrSlipping slipping(p, {1.0, 0.01});
  const MbbrMotion m(Vec2(0.1, -0.2), Vec3(0.3, -0.4, 6.0), Vec2(3.0, -2.0));
  const MbbrLoads loads{Vec3(0.02, -0.05, 0.03), Vec3(0.4, -0.2, 0.1), Vec2(0.3, 0.1)};
  const MbbrAccelerations a = rolling.accelerations(m, rolling.mass(m), loads);
  const MbbrSlipAccelerations s =
      slipping.accelerations(m, slipping.mass(m), loads, slipping.needed(m, loads, a));
  EXPECT_LT((s.omega_dot_B - a.omega_dot_B).norm(), 1e-9);
  EXPECT_LT((s.ball_dot.head<2>() - a.phi_ddot_inertial).norm(), 1e-9);
  EXPECT_NEAR(s.ball_dot.z(), 0.0, 1e-9);
  EXPECT_LT((s.centre_star - ball_velocity(p.r, a.phi_ddot_inertial)).norm(), 1e-10);
}

TEST(SlippingBall, AtRestTheFloorCarriesTheWeightAndNothingElse) {
  const MbbrParameters p;
  const MbbrDynamics rolling{p};
  const MbbrSlipping slipping(p, {0.5, 0.004});
  const MbbrFloorForce f = slipping.needed({}, {}, rolling.accelerations({}, Vec3::Zero()));
  EXPECT_NEAR(f.normal_N, (p.m_t + p.m_b) * kGravity_m_s2, 1e-12);
  EXPECT_LT(f.force_star_N.norm(), 1e-12);
  EXPECT_TRUE(slipping.carries(f));
}

TEST(SlippingBall, AGripThatIsNeverExceededChangesNothing) {
  MbbrWorldParams w = quiet();
  World held(w);
  w.floor = {5.0, 0.1};
  World gripped(w);
  held.run(kTip, 10);
  gripped.run(kTip, 10);
  EXPECT_FALSE(gripped.slipped());
  EXPECT_EQ(held.truth().phi, gripped.truth().phi);
  EXPECT_EQ(held.truth().theta_xy, gripped.truth().theta_xy);
}

TEST(SlippingBall, OnIceTheBallTurnsAndTheRobotStaysWhereItIs) {
  MbbrWorldParams w = quiet();
  w.common.friction = false;
  World rough(w);
  w.floor = {1e-6, 1e-6};
  World ice(w);
  rough.run(kTip, 6);
  ice.run(kTip, 6);
  EXPECT_TRUE(ice.slipped());
  EXPECT_GT(rough.position_m().norm(), 1e-3);
  // Without a floor force the centre of mass stays: what the ball's centre moves, the leaning body moves
  // back.
  const MbbrParameters p;
  const Vec2 tilt = ice.truth().theta_xy;
  const Vec2 lean(std::sin(tilt.y()) * std::cos(tilt.x()), -std::sin(tilt.x()));
  const double share = p.m_t / (p.m_t + p.m_b);
  EXPECT_LT((ice.position_m() + share * p.l * rotate(ice.truth().theta_z, lean)).norm(), 1e-7);
  EXPECT_GT(ice.truth().phi_dot_star.norm(), rough.truth().phi_dot_star.norm());
}

TEST(SlippingBall, AThinContactLetsTheBallSpinInsteadOfTheRobot) {
  MbbrWorldParams w = quiet();
  World held(w);
  w.floor = {0.6, 0.0005};
  World thin(w);
  held.run(kSpin, 20);
  thin.run(kSpin, 20);
  EXPECT_TRUE(thin.slipped());
  EXPECT_LT(std::abs(thin.truth().theta_z), 0.5 * std::abs(held.truth().theta_z));
}

TEST(SlippingBall, AskedGentlyItRollsAgain) {
  MbbrWorldParams w = quiet();
  w.floor = {0.3, 0.001};
  World world(w);
  world.run(kSpin, 10);
  ASSERT_TRUE(world.slipped());
  MbbrWorld again(MbbrParameters(), MotorParameters(), Calibration(), w);
  MotorCommand command{};
  command.enable = true;
  for (int i = 0; i < 3; ++i) command.duty[i] = 0.9;
  for (int i = 0; i < 10; ++i) again.advance(command);
  ASSERT_TRUE(again.slipping());
  for (double& duty : command.duty) duty = 0.0;
  for (int i = 0; i < 60 && again.slipping(); ++i) again.advance(command);
  EXPECT_FALSE(again.slipping());
}

TEST(WheelGrip, TheContactCarriesTheMotorLessTheGearboxFriction) {
  MbbrDriveParams p;
  p.wheel_grip = 0.6;
  p.gearbox_friction_share = 1.0;
  const MbbrParameters robot;
  const double limit = grip_limit_N_m(0.6, robot);
  const MbbrDrive drive(robot, p);
  const MbbrKinematics kinematics(robot);
  const Vec3 friction_wheel = Vec3::Constant(-0.5 * limit);
  const Vec3 friction_B = kinematics.axes_from_wheels(friction_wheel);
  // 1.4 limits of motor torque, half a limit lost in the gearbox: 0.9 reach the contact, which holds.
  const Vec3 torque = drive.torque_B(Vec3::Constant(1.4 * limit), friction_B);
  EXPECT_LT((torque - kinematics.axes_from_wheels(Vec3::Constant(0.9 * limit))).norm(), 1e-12);
  // 2 limits: 1.5 reach it, it passes 1.
  const Vec3 slipping = drive.torque_B(Vec3::Constant(2.0 * limit), friction_B);
  EXPECT_LT((slipping - kinematics.axes_from_wheels(Vec3::Constant(limit))).norm(), 1e-12);
  // The same friction beyond the contact does not help it.
  p.gearbox_friction_share = 0.0;
  const Vec3 beyond = MbbrDrive(robot, p).torque_B(Vec3::Constant(1.4 * limit), friction_B);
  EXPECT_LT((beyond - kinematics.axes_from_wheels(Vec3::Constant(0.5 * limit))).norm(), 1e-12);
}

TEST(WheelGrip, LoadsFollowTiltAndAcceleration) {
  MbbrDriveParams p;
  p.wheel_grip = 1.0;
  const MbbrParameters robot;
  const Vec3 weight(0.0, 0.0, robot.m_t * kGravity_m_s2);
  const auto passed = [&](const Vec3& body_force_B) {
    MbbrDrive drive(robot, p);
    drive.carry(body_force_B, Vec3::Zero(), Vec3::Zero());
    const Vec3 torque_B = drive.torque_B(Vec3::Constant(100.0), Vec3::Zero());
    return Vec3(MbbrKinematics(robot).wheels_from_axes(torque_B));
  };
  const Vec3 upright = passed(weight);
  EXPECT_LT((upright - Vec3::Constant(grip_limit_N_m(1.0, robot))).norm(), 1e-9);  // (2.2)
  EXPECT_LT((passed(2.0 * weight) - 2.0 * upright).norm(), 1e-9);
  const Vec3 leaning = passed(weight + Vec3(1.0, 0.0, 0.0));
  EXPECT_GT(leaning.maxCoeff(), upright.x() + 1e-3);
  EXPECT_LT(leaning.minCoeff(), upright.x() - 1e-3);
}

TEST(RollingResistance, SlowsBothRobots) {
  const auto rolled = [](double resistance) {
    MbbrWorldParams w = quiet();
    w.common.friction = false;
    w.common.rolling_resistance = resistance;
    w.common.floor_slope_rad = Vec2(0.02, 0.0);
    return std::abs(World(w).run({0.0, 0.0, 0.0}, 20).position_m().x());
  };
  EXPECT_LT(rolled(0.01), 0.8 * rolled(0.0));
  const auto driven = [](double resistance) {
    MipWorldParams w;
    w.common.initial_tilt_rad = 0.0;
    w.common.friction = false;
    w.common.rolling_resistance = resistance;
    w.common.floor_slope_rad = Vec2(0.0, 0.05);
    MipWorld world(MipParameters(), MotorParameters(), Calibration(), w);
    MotorCommand command{};
    command.enable = true;
    for (int i = 0; i < 10; ++i) world.advance(command);
    return std::abs(world.truth().position_W_m.y());
  };
  EXPECT_LT(driven(0.02), 0.8 * driven(0.0));
}

TEST(Gyro, ScaleErrorAndWarmingUpAddToWhatItFeels) {
  MbbrWorldParams w = quiet();
  World plain(w);
  plain.run(kSpin, 20);
  w.common.gyro_scale_error = Vec3(0.0, 0.0, 0.01);
  World stretched(w);
  stretched.run(kSpin, 20);
  EXPECT_NEAR(stretched.raw().gyro_counts[2] / plain.raw().gyro_counts[2], 1.01, 1e-9);
  w.common.gyro_scale_error.setZero();
  w.common.gyro_drift_rad_s = Vec3(0.01, 0.0, 0.0);
  w.common.warm_up_s = 0.1;
  World warm(w);
  warm.run(kSpin, 20);
  const double counts_per_rad_s = 1.0 / Calibration().gyro_rad_s_per_count;
  EXPECT_NEAR(warm.raw().gyro_counts[0] - plain.raw().gyro_counts[0],
              0.01 * (1.0 - std::exp(-1.0)) * counts_per_rad_s, 1e-6);
}

}  // namespace
}  // namespace equipoise
