// Effects that sensors, motors and loop of any robot have, each alone and against its formula.
#include <gtest/gtest.h>

#include "robots/mip/world.hpp"
#include "unit/plant/level_world.hpp"

namespace equipoise {
namespace {

MbbrWorld world_of(const MbbrWorldParams& p) {
  return {MbbrParameters{}, MotorParameters{}, Calibration{}, p};
}

MotorCommand with_duty(double duty) {
  MotorCommand on{};
  on.enable = true;
  for (int i = 0; i < 3; ++i) on.duty[i] = duty;
  return on;
}

TEST(Sensors, ScaleErrorOfTheAccelerometerIsAFactor) {
  MbbrWorldParams w = level_world();
  const RawSample plain = world_of(w).sense();
  w.common.accel_scale_error = Vec3(0.0, 0.0, 0.03);
  EXPECT_NEAR(world_of(w).sense().accel_counts[2], 1.03 * plain.accel_counts[2], 1e-9);
}

TEST(Sensors, GyroBiasFollowsTheTemperature) {
  // 0.24 deg/s per kelvin, 5 K above the calibration and 3 K more in the end.
  constexpr double kDrift = 0.24 * kPi / 180.0;
  MbbrWorldParams w = level_world();
  w.common.gyro_drift_rad_s_K = Vec3(0.0, 0.0, kDrift);
  w.common.warm_K = 5.0;
  w.common.warm_up_K = 3.0;
  w.common.warm_up_s = 2.0;
  MbbrWorld world = world_of(w);
  const double per_count = Calibration{}.gyro_rad_s_per_count;
  EXPECT_NEAR(world.sense().gyro_counts[2] * per_count, 5.0 * kDrift, 1e-9);
  for (int i = 0; i < 400; ++i) world.advance(MotorCommand{});
  EXPECT_NEAR(world.sense().gyro_counts[2] * per_count, (5.0 + 3.0 * (1.0 - std::exp(-1.0))) * kDrift, 1e-6);
}

TEST(Sensors, AnImuWithASlowerClockRepeatsThatShare) {
  MbbrWorldParams w = level_world();
  w.common.imu_repeat_share = 0.05;
  w.common.gyro_sigma_rad_s = 0.01;
  MbbrWorld world = world_of(w);
  double before = world.sense().gyro_counts[0];
  int repeats = 0;
  int in_a_row = 0;
  for (int i = 0; i < 2000; ++i) {
    world.advance(MotorCommand{});
    const double now = world.sense().gyro_counts[0];
    in_a_row = now == before ? in_a_row + 1 : 0;
    EXPECT_LE(in_a_row, 1);
    repeats += in_a_row;
    before = now;
  }
  EXPECT_NEAR(repeats, 100, 1);
}

TEST(Sensors, AMassCentreOffTheAxisIsAMountThatTheWheelsShare) {
  MbbrWorldParams w = level_world();
  w.common.com_offset_rad = Vec2(0.03, 0.0);
  const RawSample raw = world_of(w).sense();
  // The chassis hangs over by that about x: gravity shows in its y axis.
  EXPECT_NEAR(raw.accel_counts[1] / raw.accel_counts[2], std::tan(0.03), 1e-6);
  // A wheel turns as fast as the ball about the wheel's axis, which hangs over too.
  w.common.friction = false;
  MbbrWorld hung = world_of(w);
  w.common.com_offset_rad.setZero();
  MbbrWorld straight = world_of(w);
  for (int i = 0; i < 40; ++i) {
    straight.advance(with_duty(0.9));
    hung.advance(with_duty(0.9));
  }
  const double tilt = hung.truth().omega_B.head<2>().norm();
  EXPECT_LT(straight.truth().omega_B.head<2>().norm(), 1e-6);
  EXPECT_GT(tilt, 1e-2);
}

TEST(Motors, ABridgeThatSwitchesOnLateLosesDuty) {
  EXPECT_DOUBLE_EQ(switched_duty(0.5, 10e-6 * 20e3), 0.3);  // 10 us of 50 us
  EXPECT_DOUBLE_EQ(switched_duty(-0.5, 10e-6 * 20e3), -0.3);
  EXPECT_DOUBLE_EQ(switched_duty(0.1, 0.2), 0.0);
  EXPECT_DOUBLE_EQ(switched_duty(1.0, 0.2), 1.0);  // nothing switches
  MbbrWorldParams w = level_world();
  const auto turned = [](const MbbrWorldParams& p, double duty) {
    MbbrWorld world = world_of(p);
    for (int i = 0; i < 20; ++i) world.advance(with_duty(duty));
    return world.truth().theta_z;
  };
  const double expected = turned(w, 0.7);
  w.common.bridge_on_delay_s = 18e-6;
  w.common.bridge_off_delay_s = 8e-6;
  EXPECT_NEAR(turned(w, 0.9), expected, 1e-9);
}

TEST(Friction, ChangesFromItsStartToItsEnd) {
  WorldParams p;
  p.friction_scale = Vec2(0.7, 2.0);
  p.friction_time_s = 20.0;
  EXPECT_DOUBLE_EQ(p.friction_now(0.0), 0.7);
  EXPECT_NEAR(p.friction_now(20.0), 2.0 - 1.3 * std::exp(-1.0), 1e-12);
  // What holds wheels at twice the friction lets them go at once.
  const MbbrParameters robot;
  MotorParameters brake;
  brake.bridge = BridgeType::kDriveBrake;
  const double duty = 1.5 * robot.mu_c / (robot.r / robot.r_w * std::sqrt(3.0) * brake.k1());
  const auto turned = [&](double scale) {
    MbbrWorldParams w = level_world();
    w.common.friction_scale = Vec2::Constant(scale);
    MbbrWorld world(robot, brake, Calibration(), w);
    for (int i = 0; i < 40; ++i) world.advance(with_duty(duty));
    return std::abs(world.truth().theta_z);
  };
  EXPECT_GT(turned(1.0), 0.05);
  EXPECT_LT(turned(2.0), 1e-9);
}

TEST(Loop, MissesThatShareOfItsTicks) {
  MbbrWorldParams w = level_world();
  w.common.missed_tick_share = 0.1;
  MbbrWorld world = world_of(w);
  for (int i = 0; i < 2000; ++i) world.advance(MotorCommand{});
  EXPECT_NEAR(world.time_s() / (2000 * kTickS), 1.1, 0.025);  // sigma 0.0067
}

TEST(Pushes, OneInEachIntervalButTheFirst) {
  WorldParams w;
  w.random_pushes = {2.0, 0.05, 1.5};
  double first_at_s = 0.0;
  for (int interval = 0; interval < 20; ++interval) {
    int pushed = 0;
    for (int i = 0; i < 2000; ++i) {
      const double t = 2.0 * interval + 0.001 * i;
      const double force = push_force_W(w, t).norm();
      if (force == 0.0) continue;
      if (first_at_s == 0.0) first_at_s = t;
      EXPECT_NEAR(force, 1.5, 1e-12);
      ++pushed;
    }
    EXPECT_NEAR(pushed, interval == 0 ? 0 : 50, 1) << interval;
  }
  w.seed = 2;
  EXPECT_EQ(push_force_W(w, first_at_s).norm(), 0.0);  // another robot's come at other times
}

TEST(Actual, AWiderTrackTurnsSlower) {
  ActualScales a;
  a.track = 1.24;
  EXPECT_DOUBLE_EQ(as_built(MipParameters{}, a).d, 1.24 * MipParameters{}.d);
}

}  // namespace
}  // namespace equipoise
