// What contacts carry: the ball on the floor, the wheels on the ball; and what else a built robot has.
#include <gtest/gtest.h>

#include "robots/mip/world.hpp"
#include "support/oracle.hpp"
#include "unit/plant/level_world.hpp"

namespace equipoise {
namespace {

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
  MbbrWorldParams w = level_world();
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
  MbbrWorldParams w = level_world();
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
  MbbrWorldParams w = level_world();
  World held(w);
  w.floor = {0.6, 0.0005};
  World thin(w);
  held.run(kSpin, 20);
  thin.run(kSpin, 20);
  EXPECT_TRUE(thin.slipped());
  EXPECT_LT(std::abs(thin.truth().theta_z), 0.5 * std::abs(held.truth().theta_z));
}

TEST(SlippingBall, AskedGentlyItRollsAgain) {
  MbbrWorldParams w = level_world();
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

/// One step of a wheel on a ball that cannot turn.
MbbrFriction against_a_held_ball(const MbbrRotors& rotors) {
  return contact_friction(1e-12 * Mat<6, 6>::Identity(), Vec<6>::Zero(), Vec3::Zero(), rotors,
                          {kNeverGivesWay, kNeverGivesWay, 0.0});
}

TEST(WheelGrip, TheContactCarriesTheMotorLessTheGearboxFriction) {
  MbbrRotors rotors;
  rotors.compliance.setConstant(500.0);
  rotors.gear_N_m.setConstant(0.01);
  rotors.grip_N_m.setConstant(0.03);
  // 0.035 N m of the motor, 0.01 lost in the gearbox: 0.025 reach the contact, which holds.
  rotors.free_rad_s = Vec3(500.0 * 0.035, -500.0 * 0.035, 0.0);
  const MbbrFriction held = against_a_held_ball(rotors);
  EXPECT_TRUE(held.holds);
  EXPECT_LT((held.wheels - Vec3(0.025, -0.025, 0.0)).norm(), 1e-9);
  EXPECT_LT(held.rotor_rad_s.norm(), 1e-6);
  // 0.05: 0.04 reach it, it passes 0.03, and the rest turns the rotor.
  rotors.free_rad_s = Vec3(500.0 * 0.05, 0.0, 0.0);
  const MbbrFriction slips = against_a_held_ball(rotors);
  EXPECT_FALSE(slips.holds);
  EXPECT_LT((slips.wheels - Vec3(0.03, 0.0, 0.0)).norm(), 1e-9);
  EXPECT_LT((slips.rotor_rad_s - Vec3(500.0 * 0.01, 0.0, 0.0)).norm(), 1e-6);
}

TEST(WheelGrip, ASlippingMotorRunsAtWhatGripAndGearboxLeaveIt) {
  // Drive/brake: stall torque (u - rate / no-load rate) = grip + gearbox friction in the end.
  MbbrDriveParams p;
  p.wheel_grip = 0.5;
  p.gearbox_friction_share = 0.8;
  MotorParameters motor;
  motor.bridge = BridgeType::kDriveBrake;
  WorldParams common;
  common.battery_V = 8.0;
  MbbrDrive::Motors motors(motor, Calibration(), common);
  MotorCommand command{};
  command.enable = true;
  command.duty[0] = 0.9;
  motors.command(command);
  const MbbrParameters robot;
  const MbbrDrive drive(robot, p);
  Vec3 rates = Vec3::Zero();
  MbbrRotors rotors;
  for (int i = 0; i < 100; ++i) {
    rotors = drive.rotors(motors, rates, robot.mu_c, {}, 0.0, 1e-3);
    rates = against_a_held_ball(rotors).rotor_rad_s;
  }
  const double stall = 0.0742 * 8.0 / 3.385, no_load = 8.0 / 0.0742;
  const double left = 0.9 - (grip_limit_N_m(0.5, robot) + rotors.gear_N_m.x()) / stall;
  EXPECT_NEAR(rates.x(), left * no_load, 0.01);
  EXPECT_LT(rates.tail<2>().norm(), 1e-6);  // the others' friction holds them
  // [T] section 5.3 measured all gears about an axis: theirs make 0.8 of it, about x and y on average.
  const Mat3 T_ob = robot.wheel_axes();
  const double about_x = robot.r / robot.r_w * T_ob.row(0).cwiseAbs().sum() * rotors.gear_N_m.x();
  const double about_y = robot.r / robot.r_w * T_ob.row(1).cwiseAbs().sum() * rotors.gear_N_m.x();
  EXPECT_NEAR(0.5 * (about_x + about_y), 0.8 * robot.mu_c, 1e-12);
}

TEST(WheelGrip, LoadsFollowTiltAndAcceleration) {
  MbbrDriveParams p;
  p.wheel_grip = 1.0;
  const MbbrParameters robot;
  const Vec3 weight(0.0, 0.0, robot.m_t * kGravity_m_s2);
  const auto carried = [&](const Vec3& body_force_B) {
    MbbrDrive drive(robot, p);
    drive.carry(body_force_B, Vec3::Zero());
    return drive.grip_N_m();
  };
  const Vec3 upright = carried(weight);
  EXPECT_LT((upright - Vec3::Constant(grip_limit_N_m(1.0, robot))).norm(), 1e-9);  // (2.2)
  EXPECT_LT((carried(2.0 * weight) - 2.0 * upright).norm(), 1e-9);
  const Vec3 leaning = carried(weight + Vec3(1.0, 0.0, 0.0));
  EXPECT_GT(leaning.maxCoeff(), upright.x() + 1e-3);
  EXPECT_LT(leaning.minCoeff(), upright.x() - 1e-3);
}

TEST(Contacts, MoveTheRobotAsBodiesThatTouchDoInMuJoCo) {
  // tests/python/mujoco_contacts.py: wheels, ball and floor with Coulomb contacts. Without friction in gears.
  MbbrParameters robot;
  robot.I_w = 1e-6;
  MotorParameters motor;
  motor.bridge = BridgeType::kDriveBrake;
  for (const auto& row : test::oracle_rows("mbbr_contacts")) {
    MbbrWorldParams p = level_world();
    p.common.friction = false;
    p.common.battery_V = 8.0;
    p.drive.wheel_grip = row.at("wheel_grip");
    p.floor = {row.at("floor_grip"), row.at("torsion_radius_m")};
    p.common.pushes = {{0.0, 0.05, test::vector_of<2>(row, "push_W_N")}};
    MbbrWorld world(robot, motor, Calibration(), p);
    MotorCommand command{};
    command.enable = true;
    const Vec3 duty = test::vector_of<3>(row, "duty");
    std::copy(duty.begin(), duty.end(), command.duty);
    const double at_s = row.at("at_s");
    while (world.time_s() < at_s - 0.5 * kTickS) world.advance(command);
    const MbbrEstimate x = world.truth();
    Vec3 theta;
    theta << x.theta_xy, x.theta_z;
    const Vec3 theta_there = test::vector_of<3>(row, "theta");
    const Vec3 omega_there = test::vector_of<3>(row, "omega_B");
    const Vec2 ball_there = test::vector_of<2>(row, "phi_star_dot");
    const Vec2 path = ball_velocity(robot.r, x.phi);
    // To 3 % where nothing slips; contacts that slide chatter there: its answers differ by a fifth with their
    // stiffness.
    const double apart = world.slipping() ? 0.2 : 0.03;
    EXPECT_LT((theta - theta_there).norm(), 0.001 + apart * theta_there.norm()) << row;
    EXPECT_LT((x.omega_B - omega_there).norm(), 0.02 + apart * omega_there.norm()) << row;
    EXPECT_LT((x.phi_dot_star - ball_there).norm(), 0.05 + apart * ball_there.norm()) << row;
    EXPECT_LT((path - test::vector_of<2>(row, "path_m")).norm(), 0.0002 + apart * path.norm()) << row;
  }
}

TEST(Gyro, ScaleErrorAndWarmingUpAddToWhatItFeels) {
  MbbrWorldParams w = level_world();
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
