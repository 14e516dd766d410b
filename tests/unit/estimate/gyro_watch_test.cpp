// A gyro that lies, against wheels that do not.
#include "equipoise/estimate/gyro_watch.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <functional>

namespace equipoise {
namespace {

/// Torque that turns body and wheels back and forth about all axes, each wheel about an axis between two of
/// the body's.
class Twist {
 public:
  explicit Twist(const GyroWatchParams<3>& p = params()) : watch_(p) {}

  static GyroWatchParams<3> params() {
    GyroWatchParams<3> p;
    p.from_wheels << -0.3, -0.3, 0.3, -0.3, 0.3, -0.3, 0.3, -0.3, -0.3;
    p.sigma_rad_s = Vec3::Constant(0.05);
    p.max_step_rad_s = Vec3::Constant(3.0);
    p.balances = {true, true, false};
    p.per_jump = {5.0, 5.0, 0.0};
    p.by_torque.setIdentity();
    return p;
  }

  /// Ticks until the gyro is not trusted; `lie`: what it makes of the truth.
  int run(const std::function<Vec3(const Vec3&)>& lie, double accel_nis = 2.0, int ticks = 200) {
    for (int i = 0; i < ticks; ++i, ++tick_) {
      const double t = tempo * kTickS * tick_;
      Vec3 omega(1.5 * std::sin(11.0 * t), 1.2 * std::sin(19.0 * t + 1.0), 0.8 * std::sin(7.0 * t + 2.0));
      omega *= amplitude;
      Measurement<3> z;
      z.imu_ok = z.encoders_ok = true;
      z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
      z.gyro_B_rad_s = lie(omega);
      angle_ += kTickS * params().from_wheels.inverse() * omega;
      z.wheel_angle_rad = angle_;
      if (counts_backwards) z.wheel_angle_rad(0) *= -1.0;
      watch_.screen(z, omega, u);
      GyroWitness<3> witness;
      witness.accel_nis = accel_nis;
      witness.blamed_wheel = blames_wheel ? 0 : -1;
      witness.wheel_stands = wheel_stands;
      witness.held_slip_rad_s = held_slip_rad_s;
      watch_.compare(z, witness);
      off_rad_s = z.gyro_B_rad_s - omega;
      if (!watch_.trusted()) return i + 1;
    }
    return 0;
  }
  const GyroWatch<3>& watch() const { return watch_; }
  void reset() { watch_.reset(); }
  bool blames_wheel = false;
  bool wheel_stands = false;
  double held_slip_rad_s = 0.0;
  bool counts_backwards = false;  // the wheel that is blamed
  double amplitude = 1.0;
  Vec3 u = Vec3::Zero();          // torque, as an input
  Vec3 off_rad_s = Vec3::Zero();  // what the filter gets of the lie
  double tempo = 1.0;

 private:
  GyroWatch<3> watch_;
  Vec3 angle_ = Vec3::Zero();
  int tick_ = 0;
};

Vec3 truth(const Vec3& omega) { return omega; }

TEST(GyroWatchTest, TrustsTheTruth) { EXPECT_EQ(Twist().run(truth, 2.0, 2000), 0); }

TEST(GyroWatchTest, FindsAFlippedAxisThatBalances) {
  for (int axis = 0; axis < 2; ++axis) {
    Twist twist;
    ASSERT_EQ(twist.run(truth), 0);
    const int found = twist.run([axis](const Vec3& omega) {
      Vec3 g = omega;
      g(axis) *= -1.0;
      return g;
    });
    EXPECT_GT(found, 0);
    EXPECT_LE(found, 60);  // while the axes move alike, there is nothing to find
  }
}

TEST(GyroWatchTest, FindsSwappedAxesAlsoOfASensorOnItsSide) {
  for (const double sign : {1.0, -1.0}) {
    for (int axis = 0; axis < 3; ++axis) {
      Twist twist;
      ASSERT_EQ(twist.run(truth), 0);
      const int found = twist.run([axis, sign](const Vec3& omega) {
        Vec3 g = omega;
        g(axis) = sign * omega((axis + 1) % 3);
        g((axis + 1) % 3) = sign * omega(axis);
        return g;
      });
      EXPECT_GT(found, 0) << sign << " " << axis;
      EXPECT_LE(found, 60);  // while the axes move alike, there is nothing to find
    }
  }
}

/// No step of it is odd in itself.
Twist shiver() {
  Twist twist;
  twist.amplitude = 0.3;
  twist.tempo = 4.0;
  return twist;
}

TEST(GyroWatchTest, WithAWheelBlamedTheGyroNeedsMoreEvidence) {
  const auto flipped = [](const Vec3& omega) { return Vec3(-omega.x(), omega.y(), omega.z()); };
  Twist sound_wheels = shiver();
  ASSERT_EQ(sound_wheels.run(truth), 0);
  const int at_once = sound_wheels.run(flipped);
  Twist blamed = shiver();
  blamed.blames_wheel = true;
  ASSERT_EQ(blamed.run(truth), 0);
  const int later = blamed.run(flipped);
  EXPECT_GT(later, at_once);
  EXPECT_LE(later, 60);
}

TEST(GyroWatchTest, ABlamedWheelThatStandsStillIsNoFaultOfTheGyro) {
  const auto flipped = [](const Vec3& omega) { return Vec3(-omega.x(), omega.y(), omega.z()); };
  Twist stands = shiver();
  stands.blames_wheel = stands.wheel_stands = true;
  ASSERT_EQ(stands.run(truth), 0);
  Twist turns = shiver();
  turns.blames_wheel = true;
  ASSERT_EQ(turns.run(truth), 0);
  EXPECT_GT(turns.run(flipped), 0);
  EXPECT_EQ(stands.run(flipped), 0);
}

/// So gently that no three ticks of it say anything.
Twist sway(double slow_sigma_rad_s) {
  GyroWatchParams<3> p = Twist::params();
  p.slow_sigma_rad_s = Vec3::Constant(slow_sigma_rad_s);
  Twist twist(p);
  twist.amplitude = 0.1;
  return twist;
}

Vec3 swapped_yz(const Vec3& omega) { return {omega.x(), omega.z(), omega.y()}; }

TEST(GyroWatchTest, SwappedAxesThatWereTakenForAnEncoderAreTheGyroAtOnce) {
  Twist robot = sway(0.01);
  ASSERT_EQ(robot.run(truth), 0);
  EXPECT_EQ(robot.run(swapped_yz), 0);  // nobody else is blamed for it yet
  robot.blames_wheel = true;
  EXPECT_EQ(robot.run(truth), 1);  // what was seen before counts
  Twist unexamined = sway(0.0);
  unexamined.blames_wheel = true;
  EXPECT_EQ(unexamined.run(swapped_yz), 0);
}

TEST(GyroWatchTest, ASpinThatNoWheelFollowsIsTheGyros) {
  GyroWatchParams<3> p = Twist::params();
  p.max_held_slip_rad_s = 0.4;
  Twist robot(p);
  ASSERT_EQ(robot.run(truth), 0);
  robot.held_slip_rad_s = 0.39;
  EXPECT_EQ(robot.run(truth), 0);
  robot.held_slip_rad_s = -0.41;
  EXPECT_EQ(robot.run(truth, 2.0, 2), 0);
  robot.held_slip_rad_s = 0.0;
  EXPECT_EQ(robot.run(truth, 2.0, 1), 0) << "ticks in a row";
  robot.held_slip_rad_s = -0.41;
  EXPECT_EQ(robot.run(truth), 3);
  Twist two_wheels;
  two_wheels.held_slip_rad_s = 2.0;
  EXPECT_EQ(two_wheels.run(truth), 0) << "not where it is of no interest";
}

TEST(GyroWatchTest, AnEncoderThatCountsBackwardsIsNoSwapOfAxes) {
  Twist robot = sway(0.01);
  ASSERT_EQ(robot.run(truth), 0);
  robot.counts_backwards = true;
  EXPECT_EQ(robot.run(truth, 2.0, 20), 0);
  robot.blames_wheel = true;
  EXPECT_EQ(robot.run(truth, 2.0, 2000), 0);
}

TEST(GyroWatchTest, WhileTheBlamedWheelStandsOnlyWhatWasSeenBeforeCounts) {
  Twist robot = sway(0.01);
  ASSERT_EQ(robot.run(truth), 0);
  robot.blames_wheel = robot.wheel_stands = true;
  EXPECT_EQ(robot.run(swapped_yz), 0);
}

TEST(GyroWatchTest, WhatNoEncoderExplainsIsTheGyroAlsoWhereNoLieFits) {
  Twist twist = shiver();
  ASSERT_EQ(twist.run(truth), 0);
  const int found =
      twist.run([](const Vec3& omega) { return Vec3(omega.x() + 2.0 * omega.y(), omega.y(), omega.z()); });
  EXPECT_GT(found, 0);
  EXPECT_LE(found, 60);
}

/// Turns evenly; nothing changes but what the gyro makes of it.
class EvenTurn {
 public:
  int run(const Vec3& gyro, int ticks) {
    for (int i = 1; i <= ticks; ++i) {
      Measurement<3> z;
      z.imu_ok = true;
      z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
      z.gyro_B_rad_s = gyro;
      watch.screen(z, turn, Vec3::Zero());
      clean = clean && (gyro == turn || !(z.gyro_B_rad_s - turn).norm() || watch.left_out());
      if (!watch.trusted()) return i;
    }
    return 0;
  }
  const Vec3 turn{0.1, -0.05, 6.0};
  GyroWatch<3> watch{Twist::params()};
  bool clean = true;  // the filter has seen nothing of the lie
};

TEST(GyroWatchTest, SeesASwapInATurnWithinThreeTicksAndKeepsItFromTheFilter) {
  EvenTurn robot;
  ASSERT_EQ(robot.run(robot.turn, 50), 0);
  EXPECT_EQ(robot.run(Vec3(0.1, 6.0, -0.05), 10), 3);
  EXPECT_TRUE(robot.clean);
}

TEST(GyroWatchTest, AFlippedAxisThatDoesNotBalanceIsLeftOut) {
  EvenTurn robot;
  ASSERT_EQ(robot.run(robot.turn, 50), 0);
  EXPECT_EQ(robot.run(Vec3(0.1, -0.05, -6.0), 50), 0);
  EXPECT_TRUE(robot.watch.left_out());
  EXPECT_TRUE(robot.clean);
  EXPECT_EQ(robot.run(robot.turn, 50), 0);
  EXPECT_TRUE(robot.watch.left_out());  // for good
}

TEST(GyroWatchTest, ARobotDoesNotShakeAsNoiseDoes) {
  const auto noisy = [](double amplitude_rad_s) {
    Twist twist;
    int tick = 0;
    return twist.run([&tick, amplitude_rad_s](const Vec3& omega) {
      const double sign = (tick++ % 4) < 2 ? 1.0 : -1.0;
      return Vec3(omega + sign * Vec3::Constant(amplitude_rad_s));
    });
  };
  EXPECT_EQ(noisy(0.1), 0);
  const int found = noisy(0.6);
  EXPECT_GT(found, 0);
  EXPECT_LE(found, 40);
}

TEST(GyroWatchTest, WhileTheAccelerometerFeelsAPushNothingIsConcluded) {
  Twist twist = shiver();
  ASSERT_EQ(twist.run(truth), 0);
  EXPECT_EQ(twist.run([](const Vec3& omega) { return Vec3(-omega.x(), omega.y(), omega.z()); }, 50.0, 60), 0);
}

TEST(GyroWatchTest, LeavesOutAnImpossibleAxisAndTrustsTheRest) {
  Twist twist;
  EXPECT_EQ(twist.run([](const Vec3& omega) { return Vec3(omega.x(), omega.y(), omega.z() + 9.0); }), 0);
  EXPECT_TRUE(twist.watch().left_out());
}

TEST(GyroWatchTest, ATiltAxisMayBeAwayForFourTicksOnly) {
  Twist twist;
  EXPECT_EQ(twist.run([](const Vec3& omega) { return Vec3(omega.x() + 9.0, omega.y(), omega.z()); }), 5);
}

/// Its count repeats itself: a quiet gyro on a robot that stands quite still, or a dead one.
TEST(GyroWatchTest, AnAxisThatStandsStillMattersOnceTheRobotMoves) {
  GyroWatch<3> watch(Twist::params());
  Measurement<3> z;
  z.imu_ok = true;
  z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
  const auto turns_by = [&](double rate_rad_s) {
    z.gyro_B_rad_s = Vec3::Zero();
    z.gyro_axis_ok = {false, true, true};
    watch.screen(z, Vec3(rate_rad_s, 0.0, 0.0), Vec3::Zero());
    EXPECT_EQ(z.gyro_B_rad_s.x(), rate_rad_s);
  };
  for (int i = 0; i < 1000; ++i) turns_by(0.02);
  EXPECT_TRUE(watch.trusted());
  EXPECT_TRUE(watch.left_out());
  for (int i = 0; i < 4; ++i) turns_by(0.06);
  EXPECT_TRUE(watch.trusted());
  turns_by(0.06);
  EXPECT_FALSE(watch.trusted());
}

TEST(GyroWatchTest, RejectsGarbageUnlessItLasts) {
  GyroWatch<3> watch(Twist::params());
  Measurement<3> garbage;
  for (int i = 1; i <= 4; ++i) {
    garbage.imu_ok = true;
    garbage.gyro_B_rad_s = Vec3(20.0, -15.0, 9.0);
    garbage.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
    watch.screen(garbage, Vec3::Zero(), Vec3::Zero());
    EXPECT_FALSE(garbage.imu_ok);
    EXPECT_EQ(watch.trusted(), i < 4) << i;
  }
}

const Vec3 kJump(0.2, 0.2, 0.2);
Vec3 jumped(const Vec3& omega) { return omega + kJump; }

TEST(GyroWatchTest, ABiasThatJumpsIsTakenOffAndTheFilterNeverSeesIt) {
  Twist twist;
  ASSERT_EQ(twist.run(truth), 0);
  for (int i = 0; i < 400; ++i) {
    ASSERT_EQ(twist.run(jumped, 2.0, 1), 0);
    ASSERT_LT(twist.off_rad_s.norm(), 1e-9) << i;
  }
  EXPECT_TRUE(twist.watch().bias_jumped());
  EXPECT_FALSE(twist.watch().left_out());
}

TEST(GyroWatchTest, AGyroWhoseBiasJumpsAgainAndAgainIsNotTrusted) {
  Twist twist;
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(twist.run(truth), 0) << i;
    ASSERT_EQ(twist.run(i % 2 == 0 ? jumped : truth), 0) << i;
  }
  EXPECT_EQ(twist.run(truth), 4);  // the fourth
}

TEST(GyroWatchTest, AJumpOfAnAxisThatDoesNotBalanceIsNotExamined) {
  Twist twist;
  ASSERT_EQ(twist.run(truth), 0);
  ASSERT_EQ(twist.run([](const Vec3& omega) { return Vec3(omega + Vec3(0.0, 0.0, 0.4)); }), 0);
  EXPECT_FALSE(twist.watch().bias_jumped());
}

TEST(GyroWatchTest, WhatATorqueExplainsIsNotExamined) {
  Twist twist;
  ASSERT_EQ(twist.run(truth), 0);
  twist.u = kJump;
  ASSERT_EQ(twist.run(jumped, 2.0, 1), 0);
  EXPECT_LT((twist.off_rad_s - kJump).norm(), 1e-12);  // goes through

  Twist late;  // the gyro sees it a tick later
  ASSERT_EQ(late.run(truth), 0);
  late.u = kJump;
  ASSERT_EQ(late.run(truth, 2.0, 1), 0);
  ASSERT_EQ(late.run(jumped, 2.0, 1), 0);
  EXPECT_LT((late.off_rad_s - kJump).norm(), 1e-12);

  Twist other;  // about another axis
  ASSERT_EQ(other.run(truth), 0);
  other.u = Vec3(0.2, -0.2, 0.2);
  ASSERT_EQ(other.run(jumped, 2.0, 1), 0);
  EXPECT_LT(other.off_rad_s.norm(), 1e-12);
}

TEST(GyroWatchTest, AFlipIsNotTakenForAJump) {
  Twist twist;
  twist.amplitude = 0.2;
  ASSERT_EQ(twist.run(truth, 2.0, 100), 0);
  (void)twist.run([](const Vec3& omega) { return Vec3(omega.cwiseProduct(Vec3(-1.0, 1.0, 1.0))); });
  EXPECT_FALSE(twist.watch().bias_jumped());
}

TEST(GyroWatchTest, ResetForgetsTheJump) {
  Twist twist;
  ASSERT_EQ(twist.run(truth), 0);
  ASSERT_EQ(twist.run(jumped), 0);
  twist.reset();
  EXPECT_FALSE(twist.watch().bias_jumped());
  ASSERT_EQ(twist.run(jumped), 0);
  EXPECT_LT((twist.off_rad_s - kJump).norm(), 1e-12);
}

}  // namespace
}  // namespace equipoise
