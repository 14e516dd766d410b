#include <gtest/gtest.h>

#include <complex>

#include "equipoise/control/friction.hpp"
#include "robots/mbbr/scheduled_feedback.hpp"
#include "robots/mbbr/thesis_feedback.hpp"

namespace equipoise {
namespace {

MbbrReferenceParams reference_params() {
  MbbrReferenceParams p;
  p.schedule.rows = 2;
  p.schedule.at = {0.0, 2.0 * kPi};
  p.schedule.row[0] = {0.2, 0.97, 10.0};
  p.schedule.row[1] = {0.1, 0.96, 15.0};
  p.max_acceleration_m_s2 = 1e6;
  p.max_yaw_acceleration_rad_s2 = 1e6;
  return p;
}

MbbrThesisFeedbackParams thesis_params() {
  MbbrThesisFeedbackParams p;
  p.schedule.rows = 2;
  p.schedule.at = {0.0, kPi};
  p.schedule.row[0] = {10.0, 0.4, 0.5, 0.075, 0.4, 1.2};
  p.schedule.row[1] = {12.0, 0.4, 0.5, 0.10, 0.4, 1.2};
  return p;
}

TEST(GainSchedule, InterpolatesWithoutJumpsAndHoldsBeyondTheEnds) {
  const auto schedule = thesis_params().schedule;
  EXPECT_DOUBLE_EQ(schedule(0.0)[0], 10.0);
  EXPECT_DOUBLE_EQ(schedule(0.5 * kPi)[0], 11.0);
  EXPECT_DOUBLE_EQ(schedule(100.0)[0], 12.0);
  double previous = schedule(0.0)[0];
  for (double x = 0.0; x < 4.0; x += 0.01) {
    const double now = schedule(x)[0];
    EXPECT_LT(std::abs(now - previous), 0.01);
    previous = now;
  }
}

TEST(MbbrReference, LeansTowardsTheTravel) {
  MbbrReferenceStage stage(reference_params());
  stage.reset(MbbrEstimate{});
  Command command;
  command.velocity_W_m_s = Vec2(0.2, 0.0);
  MbbrReference ref;
  for (int k = 0; k < 50; ++k) ref = stage.update(command, MbbrEstimate{});
  // +x travel needs +phi_y, and a positive theta_y accelerates it.
  EXPECT_GT(ref.d_phi_dot.y(), 0.0);
  EXPECT_GT(ref.theta_xy.y(), 0.0);
  EXPECT_NEAR(ref.theta_xy.x(), 0.0, 1e-12);
}

TEST(MbbrReference, IntegratesCommandsAndTurnsThemWithTheHeading) {
  MbbrReferenceStage stage(reference_params());
  MbbrEstimate x;
  x.theta_z = kPi / 2.0;  // "forward" is where the robot looked when it started
  stage.reset(x);
  Command command;
  command.velocity_W_m_s = Vec2(0.1, 0.0);
  command.yaw_rate_rad_s = 1.0;
  MbbrReference ref;
  for (int k = 0; k < 200; ++k) ref = stage.update(command, x);
  const Vec2 position = ball_velocity(0.032, ref.phi);
  EXPECT_NEAR(position.x(), 0.0, 1e-9);
  EXPECT_NEAR(position.y(), 0.1, 1e-9);
  EXPECT_NEAR(ref.theta_z, kPi / 2.0 + 1.0, 1e-9);
}

/// [T] (6.6)-(6.9): the ball's errors are inertial and resolved in the yaw frame.
TEST(MbbrReference, ErrorsAreReferenceMinusEstimateInTheYawFrame) {
  MbbrReferenceStage stage(reference_params());
  MbbrEstimate x;
  x.theta_z = kPi / 2.0;
  x.phi = Vec2(7.0, -3.0);
  stage.reset(x);
  x.phi += Vec2(0.3, 0.1);
  x.phi_dot_star = Vec2(0.5, -0.25);
  x.theta_xy = Vec2(0.02, -0.01);
  x.omega_B = Vec3(0.4, -0.2, 0.1);
  x.theta_dot = Vec3(0.3, 0.6, 0.8);
  x.theta_z += 0.2;
  const MbbrReference ref = stage.update(Command{}, x);
  const double c = std::cos(kPi / 2.0 + 0.2);
  const double s = std::sin(kPi / 2.0 + 0.2);
  EXPECT_NEAR(ref.d_phi.x(), -0.3 * c - 0.1 * s, 1e-12);
  EXPECT_NEAR(ref.d_phi.y(), 0.3 * s - 0.1 * c, 1e-12);
  EXPECT_EQ(ref.d_phi_dot_unfiltered, Vec2(-0.5, 0.25));
  EXPECT_EQ(ref.d_theta, Vec2(-0.02, 0.01)) << "no lean is asked for yet";
  EXPECT_EQ(ref.d_rate, Vec2(-0.4, 0.2)) << "body rates";
  EXPECT_NEAR(ref.d_theta_z, -0.2, 1e-12);
  EXPECT_EQ(ref.d_yaw_rate, -0.8);
  EXPECT_NEAR(ref.theta_z, kPi / 2.0, 1e-12);
  EXPECT_EQ(ref.phi, Vec2(7.0, -3.0));
  const StateView v = view(ref, MbbrParameters{});
  EXPECT_EQ(v.theta_rad, Vec3(0.0, 0.0, ref.theta_z));
  EXPECT_EQ(v.phi_rad, ref.phi);
}

/// Duty of a wheel: 0.5 may be used, 0.1 per rad/s of yaw, 2 per m/s.
TEST(MbbrReference, TravelGetsWhatTheTurnLeavesInItsDirection) {
  MbbrReferenceParams p = reference_params();
  p.budget = {0.5, 0.0, 0.1, 2.0};
  const auto speed = [&p](const Vec2& asked, double yaw_rate) {
    MbbrReferenceStage stage(p);
    stage.reset(MbbrEstimate{});
    Command command;
    command.velocity_W_m_s = asked;
    command.yaw_rate_rad_s = yaw_rate;
    MbbrReference ref;
    for (int k = 0; k < 10; ++k) ref = stage.update(command, MbbrEstimate{});
    return Vec2(ball_velocity(0.032, ref.phi_dot_star));
  };
  EXPECT_LT((speed({0.6, 0.8}, 0.0) - Vec2(0.15, 0.2)).norm(), 1e-9);
  EXPECT_LT((speed({1.2, 1.6}, 0.0) - Vec2(0.15, 0.2)).norm(), 1e-9);
  EXPECT_LT((speed({-0.6, 0.8}, -3.0) - Vec2(-0.06, 0.08)).norm(), 1e-9);
  EXPECT_LT((speed({0.03, 0.04}, 3.0) - Vec2(0.03, 0.04)).norm(), 1e-9);
}

/// (6.13) and section 6.2.1: lean(k+1) = pole lean(k) + gain unit e, e filtered to first order; (6.12).
TEST(MbbrReference, LeanAndFilteredErrorFollowTheirDifferenceEquations) {
  for (const double sign : {1.0, -1.0}) {
    MbbrReferenceParams p = reference_params();
    p.schedule.rows = 1;
    p.schedule.row[0] = {3.0, 0.5, 10.0};
    p.slc_unit = 0.002;
    p.slc_sign = sign;
    MbbrReferenceStage stage(p);
    stage.reset(MbbrEstimate{});
    MbbrEstimate x;
    x.phi_dot_star = Vec2(-0.5, 0.25);
    const Vec2 e = -x.phi_dot_star;
    const Vec2 step = sign * 3.0 * 0.002 * e;
    double lean = 0.0;  // of steps
    double left = 1.0;
    for (int k = 0; k < 6; ++k) {
      const MbbrReference ref = stage.update(Command{}, x);
      left *= std::exp(-10.0 * kTickS);
      EXPECT_LT((ref.d_phi_dot - (1.0 - left) * e).norm(), 1e-12) << k;
      EXPECT_LT((ref.theta_xy - lean * step).norm(), 1e-12) << k;
      const double before = k == 0 ? 0.0 : 2.0 * (lean - 1.0);
      EXPECT_LT((ref.rate_xy - (lean - before) * step / kTickS).norm(), 1e-9) << k;
      lean = 0.5 * lean + 1.0;
    }
  }
}

/// "Forward" is where the robot looked at the last reset of its heading.
TEST(MbbrReference, AHeadingResetTurnsForward) {
  MbbrReferenceStage stage(reference_params());
  stage.reset(MbbrEstimate{});
  MbbrEstimate x;
  x.theta_z = kPi / 2.0;
  Command command;
  command.velocity_W_m_s = Vec2(0.1, 0.0);
  command.heading_reset = true;
  MbbrReference ref;
  for (int k = 0; k < 200; ++k) {
    ref = stage.update(command, x);
    command.heading_reset = false;
  }
  const Vec2 position = ball_velocity(0.032, ref.phi);
  EXPECT_NEAR(position.x(), 0.0, 1e-9);
  EXPECT_NEAR(position.y(), 0.1, 1e-9);
}

TEST(MbbrReference, InertialFiltersDoNotLagWithTheSpin) {
  // Given a constant inertial rate error and a spinning robot, the inertial low-pass reaches it exactly; in
  // the yaw frame it is attenuated and rotated.
  for (const FilterFrame frame : {FilterFrame::kInertial, FilterFrame::kYaw}) {
    MbbrReferenceParams p = reference_params();
    p.frame = frame;
    MbbrReferenceStage stage(p);
    stage.reset(MbbrEstimate{});
    MbbrEstimate x;
    Command command;
    command.velocity_W_m_s = Vec2(0.32, 0.0);
    command.yaw_rate_rad_s = 2.0 * kPi;
    MbbrReference ref;
    for (int k = 0; k < 400; ++k) {
      x.theta_z = 2.0 * kPi * k * kTickS;
      ref = stage.update(command, x);
    }
    const double lag = (ref.d_phi_dot - ref.d_phi_dot_unfiltered).norm() / ref.d_phi_dot_unfiltered.norm();
    if (frame == FilterFrame::kInertial) {
      EXPECT_LT(lag, 1e-3);
    } else {
      EXPECT_GT(lag, 0.2);
    }
  }
}

TEST(MbbrReference, SlewLimitsBoundTheReference) {
  MbbrReferenceParams p = reference_params();
  p.max_acceleration_m_s2 = 0.5;
  p.max_yaw_acceleration_rad_s2 = 2.0;
  MbbrReferenceStage stage(p);
  stage.reset(MbbrEstimate{});
  Command command;
  command.velocity_W_m_s = Vec2(1.0, 0.0);
  command.yaw_rate_rad_s = 5.0;
  const MbbrReference ref = stage.update(command, MbbrEstimate{});
  EXPECT_NEAR(ball_velocity(0.032, ref.phi_dot_star).x(), 0.5 * kTickS, 1e-12);
  EXPECT_NEAR(ref.yaw_rate, 2.0 * kTickS, 1e-12);
}

TEST(MbbrThesisFeedback, IsMinusKTimesTheErrorWithTheScheduledGains) {
  const MbbrThesisFeedback feedback(thesis_params());
  MbbrReference ref;
  ref.d_theta = Vec2(0.01, -0.02);
  ref.d_phi = Vec2(1.0, 2.0);
  ref.d_rate = Vec2(0.1, 0.3);
  ref.d_phi_dot = Vec2(0.5, -0.5);
  ref.d_theta_z = 0.2;
  ref.d_yaw_rate = 0.4;
  const Vec3 u = feedback.update(ref);
  EXPECT_NEAR(u.x(), -(10 * 0.01 + 0.4 * 1.0 + 0.5 * 0.1 + 0.075 * 0.5), 1e-12);
  EXPECT_NEAR(u.y(), -(10 * -0.02 + 0.4 * 2.0 + 0.5 * 0.3 + 0.075 * -0.5), 1e-12);
  EXPECT_NEAR(u.z(), -(0.4 * 0.2 + 1.2 * 0.4), 1e-12);
}

TEST(MbbrThesisFeedback, FeedsTheSteadyYawTorqueForward) {
  const MbbrThesisFeedback feedback(thesis_params());
  MbbrReference ref;
  ref.yaw_rate = 2.0 * kPi * 1.5;
  EXPECT_NEAR(feedback.update(ref).z(), -0.65, 0.01);  // 0.65 at 1.5 Hz
}

MbbrScheduledFeedbackParams scheduled_params() {
  MbbrScheduledFeedbackParams p;
  p.gains = design_mbbr(MbbrParameters{}, MbbrDesignParams{});
  return p;
}

TEST(MbbrScheduledFeedback, TurnsByTheErrorsOfHeadingAndYawRate) {
  MbbrScheduledFeedbackParams p;
  p.gains = design_mbbr(MbbrParameters{}, MbbrDesignParams{});
  p.gains.yaw_angle = 2.0;
  p.gains.yaw_rate = 0.5;
  p.gains.yaw_feedforward = 0.125;
  const auto u_z = [&p](double MbbrReference::*what, double value) {
    MbbrReference ref;
    ref.*what = value;
    return MbbrScheduledFeedback(p).update(ref).z();
  };
  p.yaw_feedforward = true;
  EXPECT_EQ(u_z(&MbbrReference::d_theta_z, 0.25), -0.5);
  EXPECT_EQ(u_z(&MbbrReference::d_yaw_rate, 3.0), -1.5);
  EXPECT_EQ(u_z(&MbbrReference::yaw_rate, 4.0), 0.5);
  p.yaw_feedforward = false;
  EXPECT_EQ(u_z(&MbbrReference::yaw_rate, 4.0), 0.0);
}

TEST(MbbrScheduledFeedback, CrossGainsGrowWithTheSpinAndMirrorWithItsSign) {
  MbbrScheduledFeedback feedback(scheduled_params());
  const auto cross = [&](double hz) {
    MbbrReference ref;
    ref.yaw_rate = 2.0 * kPi * hz;
    ref.d_theta = Vec2(0.0, 0.1);
    return feedback.update(ref).x();
  };
  EXPECT_NEAR(cross(0.0), 0.0, 1e-12);
  EXPECT_GT(std::abs(cross(3.0)), std::abs(cross(1.0)));
  EXPECT_NEAR(cross(2.0), -cross(-2.0), 1e-12);
}

/// The conjugate gains when it turns the other way; that of the input before acts on what was fed back.
TEST(MbbrScheduledFeedback, IsTheComplexGainsTimesTheErrors) {
  MbbrScheduledFeedbackParams p;
  p.gains.schedule.rows = 1;
  p.gains.schedule.row[0] = {8.0, 1.0, 0.5, 0.25, 2.0, -0.5, 1.0, 0.125, 0.5, 0.25};
  for (const double way : {1.0, -1.0}) {
    const auto u = [&p, way](Vec2 MbbrReference::*error, const Vec2& value) {
      MbbrReference ref;
      ref.yaw_rate = way * 3.0;
      ref.*error = value;
      MbbrScheduledFeedback feedback(p);
      const Vec2 first = feedback.update(ref).head<2>();
      ref.*error = Vec2::Zero();
      EXPECT_EQ(feedback.update(ref).head<2>(),
                Vec2(0.5 * first.x() - way * 0.25 * first.y(), way * 0.25 * first.x() + 0.5 * first.y()));
      return first;
    };
    EXPECT_EQ(u(&MbbrReference::d_theta, {-1.0, 0.0}), Vec2(8.0, way)) << "the estimate leans by 1";
    EXPECT_EQ(u(&MbbrReference::d_phi, {0.0, -1.0}), Vec2(way * -0.25, 0.5));
    EXPECT_EQ(u(&MbbrReference::d_rate, {-1.0, 0.0}), Vec2(2.0, way * -0.5));
    EXPECT_EQ(u(&MbbrReference::d_phi_dot_unfiltered, {-1.0, 0.0}), Vec2(1.0, way * 0.125));
  }
}

/// At a constant acceleration of the ball the body holds a lean: both from the linear model.
TEST(MbbrScheduledFeedback, FeedsForwardWhatAnAccelerationTakes) {
  const MbbrParameters robot;
  const MbbrScheduledFeedbackParams p = scheduled_params();
  const MbbrLinear s = mbbr_linear(robot, 0.0);
  Eigen::Matrix2d of_lean_and_u;
  of_lean_and_u << s.A(2, 0).real(), s.b(2, 0).real(), s.A(3, 0).real(), s.b(3, 0).real();
  const Vec2 held = of_lean_and_u.inverse() * Vec2(0.0, 5.0);  // 5 rad/s^2
  MbbrReference ref;
  ref.phi_ddot_star = Vec2(5.0, 0.0);
  ref.d_theta = Vec2(-held.x(), 0.0);  // it leans as it has to
  EXPECT_NEAR(MbbrScheduledFeedback(p).update(ref).x(), held.y(), 1e-2 * std::abs(held.y()));
}

/// Every error by itself dies out in the linear model, in which each gain has its part.
TEST(MbbrScheduledFeedback, BringsEveryErrorOfTheLinearModelToRest) {
  const MbbrParameters robot;
  MbbrScheduledFeedbackParams p;
  p.gains = design_mbbr(robot, MbbrDesignParams{});
  const MbbrLinear s = mbbr_linear(robot, 0.0);
  const auto as_vector = [](std::complex<double> z) { return Vec2(z.real(), z.imag()); };
  for (int state = 0; state < 4; ++state) {
    MbbrScheduledFeedback feedback(p);
    CMatrix x = CMatrix::Zero(4, 1);
    x(state, 0) = std::complex<double>(0.03, -0.04);
    double most_lean = 0.0;
    for (int k = 0; k < 10 * static_cast<int>(kTickHz); ++k) {
      MbbrReference ref;  // at rest
      ref.d_theta = as_vector(-x(0, 0));
      ref.d_phi = as_vector(-x(1, 0));
      ref.d_rate = as_vector(-x(2, 0));
      ref.d_phi_dot_unfiltered = as_vector(-x(3, 0));
      const Vec3 u = feedback.update(ref);
      constexpr int kSteps = 10;
      for (int i = 0; i < kSteps; ++i)
        x += kTickS / kSteps * CMatrix(s.A * x + s.b * std::complex<double>(u.x(), u.y()));
      most_lean = std::max(most_lean, std::abs(x(0, 0)));
    }
    EXPECT_LT(x.norm(), 2e-3) << "from state " << state;
    EXPECT_LT(most_lean, 0.1) << "from state " << state;
  }
}

TEST(MbbrScheduledFeedback, LeanIsCorrectedByDrivingTheBallUnderIt) {
  MbbrScheduledFeedback feedback(scheduled_params());
  MbbrReference ref;
  ref.d_theta = Vec2(-0.05, 0.0);            // the estimate leans by +0.05
  EXPECT_GT(feedback.update(ref).x(), 0.0);  // +u_x pushes theta_x negative
}

TEST(FrictionCompensation, SmoothSignReaches95PercentAtOneAndAHalf) {
  EXPECT_NEAR(FrictionCompensation::smooth_sign(1.5), 0.95, 0.001);
  EXPECT_EQ(FrictionCompensation::smooth_sign(0.0), 0.0);
  EXPECT_DOUBLE_EQ(FrictionCompensation::smooth_sign(-0.7), -FrictionCompensation::smooth_sign(0.7));
  FrictionCompensation friction;
  friction.coulomb_u = 0.3;
  EXPECT_NEAR(friction.compensate(Vec3(50.0, -50.0, 0.0)).x(), 0.3, 1e-12);
}

}  // namespace
}  // namespace equipoise
