// The MBBR's reference and scheduled feedback, number by number: what is fed forward, frames, resets, limits.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "robots/mbbr/reference.hpp"
#include "robots/mbbr/scheduled_feedback.hpp"

namespace equipoise {
namespace {

MbbrReferenceParams mbbr_reference() {
  MbbrReferenceParams p;
  p.schedule.rows = 1;
  p.schedule.row[0] = {3.0, 0.5, 10.0};
  p.slc_unit = 0.002;
  p.max_acceleration_m_s2 = 0.5;
  p.max_jerk_m_s3 = 4.0;
  p.max_yaw_acceleration_rad_s2 = 4.0;
  return p;
}

Command command_of(const Vec2& velocity, double yaw_rate) {
  Command c;
  c.velocity_W_m_s = velocity;
  c.yaw_rate_rad_s = yaw_rate;
  return c;
}

MbbrReference after(MbbrReferenceStage* stage, const Command& command, int ticks, MbbrEstimate x = {}) {
  MbbrReference ref;
  for (int k = 0; k < ticks; ++k) ref = stage->update(command, x);
  return ref;
}

/// At 90 degrees of heading, forward (+x) of the world is to the right (-y) of the robot.
TEST(MbbrReference, FeedsForwardTheBallsAccelerationAndItsRateInTheYawFrame) {
  MbbrReferenceStage stage(mbbr_reference());
  stage.reset(MbbrEstimate{});
  MbbrEstimate x;
  x.theta_z = kPi / 2.0;
  const MbbrReference first = after(&stage, command_of({1.0, 0.0}, 0.0), 1, x);
  const auto in_the_yaw_frame = [](double size) { return Vec2(ball_rate(0.032, Vec2(0.0, -size))); };
  EXPECT_LT((first.phi_dddot_star - in_the_yaw_frame(4.0)).norm(), 1e-9);
  EXPECT_LT((first.phi_ddot_star - in_the_yaw_frame(4.0 * kTickS)).norm(), 1e-9);
  EXPECT_LT((first.phi_dot_star - in_the_yaw_frame(4.0 * kTickS * kTickS)).norm(), 1e-9);
  const MbbrReference later = after(&stage, command_of({1.0, 0.0}, 0.0), 50, x);
  EXPECT_LT((later.phi_ddot_star - in_the_yaw_frame(0.5)).norm(), 1e-9) << "its limit";
  EXPECT_LT(later.phi_dddot_star.norm(), 1e-9);
}

TEST(MbbrReference, GrowsByTheSmallerLimit) {
  MbbrReferenceParams p = mbbr_reference();
  p.max_jerk_m_s3 = std::numeric_limits<double>::infinity();
  p.feasible_acceleration_m_s2 = 0.2;
  p.floor_yaw_acceleration_rad_s2 = 1.0;
  for (const double sign : {1.0, -1.0}) {
    MbbrReferenceStage stage(p);
    stage.reset(MbbrEstimate{});
    const MbbrReference ref = after(&stage, command_of({sign, 0.0}, sign * 3.0), 100);
    EXPECT_NEAR(ball_velocity(0.032, ref.phi_dot_star).x(), sign * 0.1, 1e-9);
    EXPECT_NEAR(ref.yaw_rate, sign * 0.5, 1e-9);
    EXPECT_NEAR(after(&stage, command_of({sign, 0.0}, sign * 3.0), 600).yaw_rate, sign * 3.0, 1e-12);
  }
}

/// Duty of a wheel: 0.5 may be used, 0.1 per rad/s of yaw, 2 per m/s.
TEST(MbbrReference, TravelHasRoomBesideTheTurnThatIsThereAndTheOneThatIsWanted) {
  MbbrReferenceParams p = mbbr_reference();
  p.max_jerk_m_s3 = std::numeric_limits<double>::infinity();
  p.max_acceleration_m_s2 = 1e6;
  p.budget = {0.5, 0.0, 0.1, 2.0};
  const auto speed = [](const MbbrReference& ref) { return ball_velocity(0.032, ref.phi_dot_star).norm(); };
  MbbrReferenceStage turning(p);
  turning.reset(MbbrEstimate{});
  after(&turning, command_of({0.0, 0.0}, -3.0), 200);
  EXPECT_NEAR(speed(after(&turning, command_of({0.0, 1.0}, 0.0), 1)), 0.5 * (0.5 - 0.1 * 2.98), 1e-9);
  MbbrReferenceStage standing(p);
  standing.reset(MbbrEstimate{});
  EXPECT_NEAR(speed(after(&standing, command_of({0.0, 1.0}, -3.0), 1)), 0.1, 1e-9);
}

TEST(MbbrReference, AResetForgetsTheMotion) {
  MbbrReferenceStage moved(mbbr_reference());
  MbbrEstimate x;
  x.phi_dot_star = Vec2(-0.5, 0.25);
  x.omega_B = Vec3(0.1, 0.2, 0.3);
  after(&moved, command_of({0.3, -0.2}, 2.0), 300, x);
  MbbrEstimate now;
  now.phi = Vec2(4.0, 5.0);
  now.theta_z = 1.25;
  moved.reset(now);
  MbbrReferenceStage fresh(mbbr_reference());
  fresh.reset(now);
  for (int k = 0; k < 3; ++k) {
    const MbbrReference a = moved.update(Command{}, now);
    const MbbrReference b = fresh.update(Command{}, now);
    EXPECT_EQ(a.phi, Vec2(4.0, 5.0));
    EXPECT_EQ(a.theta_z, 1.25);
    EXPECT_EQ(a.yaw_rate, 0.0);
    EXPECT_EQ(a.phi_dot_star, Vec2(0.0, 0.0));
    EXPECT_EQ(a.d_phi_dot, b.d_phi_dot);
    EXPECT_EQ(a.theta_xy, b.theta_xy);
    EXPECT_EQ(a.rate_xy, b.rate_xy);
  }
}

TEST(MbbrReference, EulerRatesAreFedBackWhereTheyAreAskedFor) {
  MbbrReferenceParams p = mbbr_reference();
  p.rate_feedback = RateFeedback::kEuler;
  MbbrReferenceStage stage(p);
  stage.reset(MbbrEstimate{});
  MbbrEstimate x;
  x.omega_B = Vec3(0.4, -0.2, 0.1);
  x.theta_dot = Vec3(0.3, 0.6, 0.8);
  EXPECT_EQ(stage.update(Command{}, x).d_rate, Vec2(-0.3, -0.6));
  // The lean stays at one angle to a robot that turns by 0.1 rad a tick: as Euler angles it does not change.
  for (const FilterFrame frame : {FilterFrame::kYaw, FilterFrame::kInertial}) {
    p.frame = frame;
    p.schedule.row[0][MbbrReferenceParams::kSlcPole] = 0.0;
    for (const RateFeedback rates : {RateFeedback::kEuler, RateFeedback::kBody}) {
      p.rate_feedback = rates;
      MbbrReferenceStage turning(p);
      turning.reset(MbbrEstimate{});
      MbbrEstimate at;
      at.phi_dot_star = Vec2(-1.0, 0.0);
      MbbrReference ref;
      for (int k = 0; k < 5; ++k) {
        at.theta_z = 0.1 * k;
        ref = turning.update(Command{}, at);
      }
      const double lean = 3.0 * 0.002;
      // Of the tick before: where the filter is the world's, it has stayed behind by one tick's turn.
      const Vec2 expected = frame == FilterFrame::kYaw ? Vec2(lean, 0.0) : rotate(-0.1, Vec2(lean, 0.0));
      EXPECT_LT((ref.theta_xy - expected).norm(), 1e-12);
      const Vec2 turned = rates == RateFeedback::kBody ? Vec2(expected - rotate(-0.1, expected)) : Vec2(0, 0);
      EXPECT_LT((ref.rate_xy - turned / kTickS).norm(), 1e-9);
    }
  }
}

TEST(MbbrReference, ItsViewIsWhereTheRobotShouldBe) {
  MbbrReference ref;
  ref.theta_xy = Vec2(0.1, 0.2);
  ref.theta_z = 0.3;
  ref.rate_xy = Vec2(0.4, 0.5);
  ref.yaw_rate = 0.6;
  ref.phi = Vec2(7.0, 8.0);
  ref.phi_dot_star = Vec2(0.9, 1.0);
  MbbrParameters robot;
  robot.r = 0.5;
  const StateView v = view(ref, robot);
  EXPECT_EQ(v.theta_rad, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(v.omega_B_rad_s, Vec3(0.4, 0.5, 0.6));
  EXPECT_EQ(v.phi_rad, Vec2(7.0, 8.0));
  EXPECT_EQ(v.phi_dot_rad_s, Vec2(0.9, 1.0));
  EXPECT_EQ(v.position_W_m, Vec2(4.0, -3.5));
}

/// A lean of `lean` per rad/s^2 belongs to an acceleration; `drive` and `speed` are u's.
TEST(MbbrScheduledFeedback, FeedsForwardByEachOfItsNumbers) {
  MbbrScheduledFeedbackParams p;
  p.gains.schedule.rows = 1;
  p.gains.schedule.row[0] = {8.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  p.gains.lean = 0.25;
  p.gains.drive = 0.5;
  p.gains.speed = 4.0;
  p.gains.speed_turn = 0.125;
  const auto u = [&p](Vec2 MbbrReference::*what, double yaw_rate = 0.0) {
    MbbrReference ref;
    ref.yaw_rate = yaw_rate;
    ref.*what = Vec2(1.0, 2.0);
    return Vec2(MbbrScheduledFeedback(p).update(ref).head<2>());
  };
  EXPECT_EQ(u(&MbbrReference::phi_ddot_star), (0.5 - 8.0 * 0.25) * Vec2(1.0, 2.0));
  EXPECT_EQ(u(&MbbrReference::phi_dddot_star), -2.0 * 0.25 * Vec2(1.0, 2.0));
  EXPECT_EQ(u(&MbbrReference::phi_dot_star), Vec2(4.0, 8.0));
  EXPECT_EQ(u(&MbbrReference::phi_dot_star, 8.0), Vec2(4.0 + 2.0, 8.0 - 1.0)) << "by minus i, per turn";
  EXPECT_EQ(u(&MbbrReference::theta_xy), Vec2(8.0, 16.0)) << "the estimate's lean, whatever was asked for";
  EXPECT_EQ(u(&MbbrReference::rate_xy), Vec2(2.0, 4.0));
}

/// Gains are of a turn to the left; to the right they are their conjugates.
TEST(MbbrScheduledFeedback, TurnsItsGainsWithTheTurn) {
  MbbrScheduledFeedbackParams p;
  p.gains.schedule.rows = 1;
  p.gains.schedule.row[0] = {8.0, 1.5, 2.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  const auto u = [&p](Vec2 MbbrReference::*what, double yaw_rate) {
    MbbrReference ref;
    ref.yaw_rate = yaw_rate;
    ref.*what = Vec2(1.0, 2.0);
    return Vec2(MbbrScheduledFeedback(p).update(ref).head<2>());
  };
  EXPECT_EQ(u(&MbbrReference::theta_xy, 3.0), Vec2(8.0 - 3.0, 16.0 + 1.5));
  EXPECT_EQ(u(&MbbrReference::theta_xy, -3.0), Vec2(8.0 + 3.0, 16.0 - 1.5));
  EXPECT_EQ(u(&MbbrReference::d_phi, -3.0), -Vec2(2.0 + 1.0, 4.0 - 0.5));
}

TEST(MbbrScheduledFeedback, OneTickWithoutANumberIsOne) {
  MbbrScheduledFeedbackParams p;
  p.gains.schedule.rows = 1;
  p.gains.schedule.row[0] = {8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0};
  MbbrScheduledFeedback feedback(p);
  MbbrReference ref;
  ref.d_theta = Vec2(std::nan(""), 0.0);
  EXPECT_FALSE(feedback.update(ref).allFinite());
  EXPECT_EQ(feedback.update(MbbrReference{}), Vec3(0.0, 0.0, 0.0));
}

}  // namespace
}  // namespace equipoise
