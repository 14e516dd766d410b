// Signs from duty to motion and from motion to samples; conventions: include/equipoise/types.hpp, [T] ch. 5.
#include <gtest/gtest.h>

#include "closed_loop.hpp"

namespace equipoise {
namespace {

ClosedLoopOptions ideal(std::uint64_t seed = 1) {
  ClosedLoopOptions options;
  options.fidelity = Fidelity::kIdeal;
  options.seed = seed;
  return options;
}

MbbrConfig config_with_tilt(double sigma_rad) {
  MbbrConfig config = mbbr_config();
  for (MbbrWorldParams& world : config.world) world.common.initial_tilt_rad = sigma_rad;
  config.safety.encoder_check_drive = 0.0;  // shaking the wheels moves the ball more than a small lean does
  return config;
}

TEST(Signs, PositiveDutyTurnsTheBallPositivelyAboutThatWheelsAxis) {
  for (std::size_t wheel = 0; wheel < Mbbr::kWheels; ++wheel) {
    for (const double sign : {1.0, -1.0}) {
      ClosedLoop loop(ideal(), config_with_tilt(0.0));
      const RawSample before = loop.world.sense();
      MotorCommand command{};
      command.enable = true;
      command.duty[wheel] = sign * 0.5;
      for (int i = 0; i < 4; ++i) loop.world.advance(command);
      const RawSample after = loop.world.sense();

      const MbbrEstimate x = loop.world.truth();
      const Vec3 ball_B =
          Vec3(x.phi_dot_star.x(), x.phi_dot_star.y(), 0.0) - x.omega_B;  // upright, no heading
      const Vec3 axis_B = MbbrKinematics(loop.config.robot).T_ob().col(static_cast<int>(wheel));
      EXPECT_GT(sign * axis_B.dot(ball_B), 1.0);
      EXPECT_GT(sign * (after.encoder_counts[wheel] - before.encoder_counts[wheel]), 5.0);
    }
  }
}

TEST(Signs, AccelerometerAtRestUprightReadsGravityMinusAcceleration) {
  ClosedLoop loop(ideal(), config_with_tilt(0.0));
  const RawSample raw = loop.world.sense();
  EXPECT_NEAR(raw.accel_counts[2], 4096.0, 1e-6);  // the chip: specific force, up
  const Measurement<3> z = calibrate<3>(raw, loop.config.calibration);
  EXPECT_NEAR(z.accel_B_m_s2.z(), -9.8, 1e-9);
  EXPECT_NEAR(z.accel_B_m_s2.head<2>().norm(), 0.0, 1e-9);
}

TEST(Signs, ControlRollsTheBallUnderTheLean) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ClosedLoop loop(ideal(seed), config_with_tilt(0.05));
    loop.run(0.5, Command{});
    const Vec2 lean = loop.world.truth().theta_xy;
    loop.run(0.05, ClosedLoop::armed());
    // Positive theta_y leans towards +x, and the ball must follow: phi_y' > 0. Likewise x.
    EXPECT_GT(lean.dot(loop.world.truth().phi_dot_star), 0.0) << "seed " << seed;
  }
}

TEST(Signs, LeansTowardsTheTravel) {
  for (const Vec2& direction : {Vec2(1, 0), Vec2(-1, 0), Vec2(0, 1), Vec2(0, -1)}) {
    ClosedLoop loop(ideal(), config_with_tilt(0.0));
    loop.balance(1.0);
    const MbbrEstimate from = loop.world.truth();
    Command drive = ClosedLoop::armed();
    drive.velocity_W_m_s = 0.2 * direction;
    Vec2 lean_sum = Vec2::Zero();
    for (int i = 0; i < 100; ++i) {  // while it speeds up
      loop.step(drive);
      const Vec2 theta = loop.world.truth().theta_xy;
      lean_sum += Vec2(theta.y(), -theta.x());  // the way the top points, world axes at zero heading
    }
    loop.run(1.5, drive);
    const double r = loop.config.robot.r;
    EXPECT_GT(direction.dot(lean_sum), 0.0);
    EXPECT_GT(direction.dot(ball_velocity(r, loop.world.truth().phi - from.phi)), 0.1);
  }
}

TEST(Signs, PositiveYawCommandTurnsTheBodyCounterclockwise) {
  ClosedLoop loop;
  loop.balance(1.0);
  Command spin = ClosedLoop::armed();
  spin.yaw_rate_rad_s = 2.0;
  const double from = loop.world.truth().theta_z;
  const ClosedLoop::Result t = loop.run(1.5, spin);
  EXPECT_GT(loop.world.truth().theta_z - from, 1.0);
  EXPECT_GT(t.z.gyro_B_rad_s.z(), 0.5);
}

}  // namespace
}  // namespace equipoise
