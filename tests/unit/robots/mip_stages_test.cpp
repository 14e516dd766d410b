// The eduMIP's reference and feedback, number by number: geometry of rolling and turning, limits, gains.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "robots/mip/lqr_feedback.hpp"
#include "robots/mip/slc_feedback.hpp"

namespace equipoise {
namespace {

MipReferenceParams mip_reference() {
  MipReferenceParams p;
  p.max_acceleration_m_s2 = 0.5;
  p.max_jerk_m_s3 = 5.0;
  p.max_yaw_acceleration_rad_s2 = 4.0;
  p.max_phi_error_rad = 6.0;
  p.wheel_radius_m = 0.034;
  return p;
}

Command command_of(double speed_m_s, double yaw_rate_rad_s) {
  Command c;
  c.velocity_W_m_s.x() = speed_m_s;
  c.yaw_rate_rad_s = yaw_rate_rad_s;
  return c;
}

/// Of a robot that is where it is told to be.
struct Follower {
  explicit Follower(const MipReferenceParams& p) : stage(p) { stage.reset(x_hat); }
  MipReference after(const Command& command, double seconds) {
    MipReference ref;
    for (int k = 0; k < std::lround(seconds * kTickHz); ++k) {
      ref = stage.update(command, x_hat);
      x_hat.phi = ref.phi;
    }
    return ref;
  }
  MipEstimate x_hat;
  MipReferenceStage stage;
};

TEST(MipReference, RollsAsFarAsItsWheelsTurnAndForwardIsMinusY) {
  for (const double speed : {0.2, -0.3}) {
    Follower robot(mip_reference());
    const MipReference at_speed = robot.after(command_of(speed, 0.0), 2.0);
    EXPECT_NEAR(at_speed.phi_dot, speed / 0.034, 1e-4);
    const MipReference later = robot.after(command_of(speed, 0.0), 1.0);
    EXPECT_NEAR(later.phi - at_speed.phi, speed / 0.034, 1e-4);
    EXPECT_NEAR(later.position_W_m.y(), -0.034 * later.phi, 1e-9) << "without slip, from the start on";
    EXPECT_NEAR(later.position_W_m.x(), 0.0, 1e-12);
    EXPECT_NEAR(later.d_phi, later.phi_dot * kTickS, 1e-9) << "a tick ahead of a robot that follows";
  }
}

TEST(MipReference, TurnsInACircleToTheLeft) {
  Follower robot(mip_reference());
  const Command command = command_of(0.2, 1.5);
  const MipReference a = robot.after(command, 2.0);
  EXPECT_NEAR(a.psi_dot, 1.5, 1e-12);
  const int half_turn = static_cast<int>(std::lround(kPi / 1.5 * kTickHz));
  const MipReference b = robot.after(command, half_turn * kTickS);
  EXPECT_NEAR(b.psi - a.psi, 1.5 * half_turn * kTickS, 1e-9);
  const Vec2 across = b.position_W_m - a.position_W_m;
  EXPECT_NEAR(across.norm(), 2.0 * 0.2 / 1.5, 1e-3);
  const Vec2 forward = rotate(a.psi, Vec2(0.0, -1.0));
  const Vec2 left(-forward.y(), forward.x());
  EXPECT_GT(across.dot(left), 0.99 * across.norm());
}

TEST(MipReference, YawGrowsByItsLimitEitherWay) {
  for (const double sign : {1.0, -1.0}) {
    Follower robot(mip_reference());
    EXPECT_NEAR(robot.after(command_of(0.0, sign * 3.0), kTickS).psi_dot, sign * 4.0 * kTickS, 1e-12);
    const MipReference ref = robot.after(command_of(0.0, sign * 3.0), 0.5);
    EXPECT_NEAR(ref.psi_dot, sign * 4.0 * 0.505, 1e-9);
    EXPECT_NEAR(robot.after(command_of(0.0, sign * 3.0), 1.0).psi_dot, sign * 3.0, 1e-12);
  }
}

TEST(MipReference, SpeedGrowsByTheSmallerLimit) {
  MipReferenceParams p = mip_reference();
  p.max_jerk_m_s3 = std::numeric_limits<double>::infinity();
  Follower robot(p);
  EXPECT_NEAR(0.034 * robot.after(command_of(0.4, 0.0), 0.5).phi_dot, 0.5 * 0.5, 1e-9);
  p.feasible_acceleration_m_s2 = 0.2;
  Follower weak(p);
  EXPECT_NEAR(0.034 * weak.after(command_of(0.4, 0.0), 0.5).phi_dot, 0.2 * 0.5, 1e-9);
}

/// Duty of a wheel: 0.5 may be used, 0.1 per rad/s of yaw, 2 per m/s.
TEST(MipReference, TravelGetsWhatTheTurnLeaves) {
  MipReferenceParams p = mip_reference();
  p.budget = {0.5, 0.0, 0.1, 2.0};
  EXPECT_NEAR(0.034 * Follower(p).after(command_of(1.0, 0.0), 5.0).phi_dot, 0.25, 1e-9);
  EXPECT_NEAR(0.034 * Follower(p).after(command_of(-1.0, -3.0), 5.0).phi_dot, -0.1, 1e-9);
  EXPECT_NEAR(Follower(p).after(command_of(0.0, 9.0), 5.0).psi_dot, 5.0, 1e-9);
  Follower robot(p);
  robot.after(command_of(0.0, 4.0), 3.0);
  EXPECT_LT(0.034 * robot.after(command_of(1.0, 0.0), 0.5).phi_dot, 0.151) << "beside the turn that is there";
  Follower fast(p);
  fast.after(command_of(1.0, 0.0), 3.0);
  EXPECT_LT(0.034 * fast.after(command_of(1.0, 4.0), 0.5).phi_dot, 0.1) << "and the one that is wanted";
}

TEST(MipReference, ErrorsAreReferenceMinusEstimate) {
  MipReferenceStage stage(mip_reference());
  MipEstimate start;
  start.phi = 5.0;
  start.psi = -2.0;
  start.position_W_m = Vec2(1.0, 2.0);
  stage.reset(start);
  MipEstimate x = start;
  x.theta = 0.1;
  x.theta_dot = -0.2;
  x.phi += 0.3;
  x.phi_dot = 0.4;
  x.psi += 0.5;
  x.psi_dot = -0.6;
  const MipReference ref = stage.update(Command{}, x);
  EXPECT_TRUE(ref.restart);
  EXPECT_EQ(ref.phi, 5.0);
  EXPECT_EQ(ref.psi, -2.0);
  EXPECT_EQ(ref.position_W_m, Vec2(1.0, 2.0));
  EXPECT_EQ(ref.d_theta, -0.1);
  EXPECT_EQ(ref.d_theta_dot, 0.2);
  EXPECT_NEAR(ref.d_phi, -0.3, 1e-12);
  EXPECT_EQ(ref.d_phi_dot, -0.4);
  EXPECT_NEAR(ref.d_psi, -0.5, 1e-12);
  EXPECT_EQ(ref.d_psi_dot, 0.6);
  EXPECT_FALSE(stage.update(Command{}, x).restart);
  x.phi = 50.0;  // carried away
  EXPECT_EQ(stage.update(Command{}, x).d_phi, -6.0);
  x.phi = -50.0;
  EXPECT_EQ(stage.update(Command{}, x).d_phi, 6.0);
  const StateView v = view(ref, MipParameters{});
  EXPECT_EQ(v.theta_rad, Vec3(0.0, 0.0, -2.0));
  EXPECT_EQ(v.phi_rad, Vec2(5.0, 0.0));
  EXPECT_EQ(v.position_W_m, Vec2(1.0, 2.0));
}

TEST(MipReference, ItsViewIsWhereTheRobotShouldBe) {
  MipReference ref;
  ref.phi_dot = 0.5;
  ref.psi_dot = 0.25;
  const StateView v = view(ref, MipParameters{});
  EXPECT_EQ(v.omega_B_rad_s, Vec3(0.0, 0.0, 0.25));
  EXPECT_EQ(v.phi_dot_rad_s, Vec2(0.5, 0.0));
}

TEST(MipReference, AResetForgetsTheMotion) {
  Follower robot(mip_reference());
  robot.after(command_of(0.3, 2.0), 3.0);
  robot.stage.reset(robot.x_hat);
  const MipReference ref = robot.after(Command{}, kTickS);
  EXPECT_EQ(ref.phi_dot, 0.0);
  EXPECT_EQ(ref.psi_dot, 0.0);
  EXPECT_TRUE(ref.restart);
}

MipReference one_error(double MipReference::*error, double value) {
  MipReference ref;
  ref.*error = value;
  return ref;
}

TEST(MipLqrFeedback, IsTheGainsTimesTheErrors) {
  MipLqrParams p;
  p.gains.lqr = {-10.0, -0.5, -1.0, -0.25, 0.0};
  p.gains.yaw.angle = 2.0;
  p.gains.yaw.rate = 0.5;
  p.gains.yaw.feedforward = 0.125;
  p.gains.speed = 0.0625;
  p.max_lean_rad = 0.1;  // of the wheels' error
  p.max_u = 1.5;
  p.soft_start_s = 0.0;
  const auto u = [&p](double MipReference::*error, double value) {
    return MipLqrFeedback(p).update(one_error(error, value));
  };
  EXPECT_EQ(u(&MipReference::d_theta, 0.05), Vec2(-0.5, 0.0));
  EXPECT_EQ(u(&MipReference::d_theta_dot, 0.5), Vec2(-0.5, 0.0));
  EXPECT_EQ(u(&MipReference::d_phi_dot, 2.0), Vec2(-0.5, 0.0));
  EXPECT_EQ(u(&MipReference::d_phi, 1.0), Vec2(-0.5, 0.0));
  EXPECT_EQ(u(&MipReference::d_phi, 9.0), Vec2(-1.0, 0.0)) << "as much as 0.1 rad of lean outweighs";
  EXPECT_EQ(u(&MipReference::d_phi, -9.0), Vec2(1.0, 0.0));
  EXPECT_EQ(u(&MipReference::phi_dot, 4.0), Vec2(0.25, 0.0)) << "against the back-EMF";
  EXPECT_EQ(u(&MipReference::d_theta, 1.0), Vec2(-1.5, 0.0)) << "the limit";
  EXPECT_EQ(u(&MipReference::d_psi, 0.25), Vec2(0.0, 0.5));
  EXPECT_EQ(u(&MipReference::d_psi_dot, 1.0), Vec2(0.0, 0.5));
  EXPECT_EQ(u(&MipReference::psi_dot, 4.0), Vec2(0.0, 0.5));
}

/// Of what is on its way to the motors: as the limit left it, without what only balances the back-EMF.
TEST(MipLqrFeedback, CountsWhatItAskedForInTheTickBefore) {
  MipLqrParams p;
  p.gains.lqr = {-10.0, 0.0, 0.0, 0.0, -0.5};
  p.gains.speed = 0.0625;
  p.max_u = 1.5;
  p.soft_start_s = 0.0;
  MipLqrFeedback feedback(p);
  const auto u = [&feedback](double d_theta, bool restart = false) {
    MipReference ref = one_error(&MipReference::d_theta, d_theta);
    ref.phi_dot = 4.0;  // against the back-EMF: 0.25
    ref.restart = restart;
    return feedback.update(ref).x();
  };
  EXPECT_EQ(u(0.05), -0.5 + 0.25);
  EXPECT_EQ(u(0.0), 0.25 + 0.25) << "half of -0.5, the other way";
  EXPECT_EQ(u(1.0), -1.5) << "the limit";
  EXPECT_EQ(u(0.0), 0.875 + 0.25) << "half of -1.75, which acted";
  EXPECT_EQ(u(0.0, true), 0.25) << "a new start forgets";
}

template <class Feedback, class Params>
void expect_a_soft_start(Params p, double asks_for_much) {
  p.max_u = 1.0;
  p.soft_start_s = 0.1;  // 20 ticks
  Feedback feedback(p);
  for (int again = 0; again < 2; ++again) {
    MipReference ref = one_error(&MipReference::d_theta, asks_for_much);
    ref.restart = true;
    EXPECT_EQ(feedback.update(ref).x(), 0.0);
    ref.restart = false;
    for (int k = 1; k < 10; ++k) feedback.update(ref);
    EXPECT_NEAR(feedback.update(ref).x(), 0.5, 1e-12);
    for (int k = 11; k < 40; ++k) feedback.update(ref);
    EXPECT_EQ(feedback.update(ref).x(), 1.0);
  }
}

TEST(MipLqrFeedback, GrowsToItsLimitOverTheSoftStart) {
  MipLqrParams p;
  p.gains.lqr = {-10.0, 0.0, 0.0, 0.0, 0.0};
  expect_a_soft_start<MipLqrFeedback>(p, -3.0);
}

TEST(MipSlcFeedback, GrowsToItsLimitOverTheSoftStart) {
  MipSlcParams p;
  p.gains.slc.D1 = {-10.0, 0.0, 0.0, 0.0, 0.0};
  expect_a_soft_start<MipSlcFeedback>(p, -3.0);
}

TEST(MipSlcFeedback, WithoutASoftStartItsLimitIsThereAtOnce) {
  MipSlcParams p;
  p.gains.slc.D1 = {-10.0, 0.0, 0.0, 0.0, 0.0};
  p.max_u = 1.0;
  p.soft_start_s = 0.0;
  EXPECT_EQ(MipSlcFeedback(p).update(one_error(&MipReference::d_theta, -3.0)).x(), 1.0);
}

/// y(k) = b0 e(k) + b1 e(k-1) + b2 e(k-2) - a1 y(k-1) - a2 y(k-2)
TEST(MipSlcFeedback, IsTheDifferenceEquationOfItsTwoLoops) {
  MipSlcParams p;
  p.gains.slc.D1 = {1.0, 2.0, 4.0, 0.5, 0.25};
  p.gains.slc.D2 = {0.5, 0.0, 0.0, 0.0, 0.0};
  p.gains.yaw.angle = 2.0;
  p.gains.yaw.rate = 0.5;
  p.gains.yaw.feedforward = 0.125;
  p.max_u = 100.0;
  p.max_lean_rad = 0.1;
  p.soft_start_s = 0.0;
  MipSlcFeedback feedback(p);
  EXPECT_EQ(feedback.update(one_error(&MipReference::d_theta, 1.0)).x(), 1.0);
  EXPECT_EQ(feedback.update(MipReference{}).x(), 2.0 - 0.5 * 1.0);
  EXPECT_EQ(feedback.update(MipReference{}).x(), 4.0 - 0.5 * 1.5 - 0.25 * 1.0);
  EXPECT_EQ(feedback.update(MipReference{}).x(), -0.5 * 3.0 - 0.25 * 1.5);
  MipReference again = one_error(&MipReference::d_phi, 0.1);
  again.restart = true;
  EXPECT_EQ(feedback.update(again).x(), 0.05) << "the outer loop's lean, and nothing from before";
  again.d_phi = 9.0;
  EXPECT_EQ(feedback.update(again).x(), 0.1) << "at most max_lean_rad";
  EXPECT_EQ(feedback.update(one_error(&MipReference::d_psi, 0.25)).y(), 0.5);
  EXPECT_EQ(feedback.update(one_error(&MipReference::d_psi_dot, 1.0)).y(), 0.5);
  EXPECT_EQ(feedback.update(one_error(&MipReference::psi_dot, 4.0)).y(), 0.5);
}

/// [T]'s library runs at 100 Hz: every other tick, with its own filters and gains of yaw.
TEST(MipSlcFeedback, AsPublishedRunsEveryOtherTick) {
  MipSlcParams p;
  p.published = true;
  p.gains.slc.D1 = p.gains.slc.D2 = {1000.0, 0.0, 0.0, 0.0, 0.0};
  p.gains.yaw.angle = 1000.0;
  p.gains.yaw_published.angle = 2.0;
  p.max_u = 100.0;
  p.soft_start_s = 0.0;
  MipSlcFeedback feedback(p);
  const auto u = [&feedback](double d_theta) {
    return feedback.update(one_error(&MipReference::d_theta, d_theta)).x();
  };
  const double first = u(1.0);
  EXPECT_DOUBLE_EQ(first, kMipPublishedD1.b0);
  EXPECT_EQ(u(5.0), first);
  EXPECT_DOUBLE_EQ(u(0.0), kMipPublishedD1.b1 - kMipPublishedD1.a1 * first);
  EXPECT_EQ(feedback.update(one_error(&MipReference::d_psi, 0.25)).y(), 0.5);
  MipSlcFeedback outer(p);
  EXPECT_DOUBLE_EQ(outer.update(one_error(&MipReference::d_phi, 0.1)).x(),
                   0.1 * kMipPublishedD2.b0 * kMipPublishedD1.b0);
}

/// A restart in the middle of the soft start and of two ticks begins both anew.
TEST(MipSlcFeedback, ARestartBeginsAnew) {
  MipSlcParams p;
  p.published = true;
  p.max_u = 1.0;
  p.soft_start_s = 0.1;
  MipSlcFeedback feedback(p);
  MipReference ref = one_error(&MipReference::d_theta, 9.0);
  for (int k = 0; k < 11; ++k) feedback.update(ref);
  EXPECT_EQ(std::abs(feedback.update(ref).x()), 0.5);
  ref.restart = true;
  EXPECT_EQ(feedback.update(ref).x(), 0.0);
}

}  // namespace
}  // namespace equipoise
