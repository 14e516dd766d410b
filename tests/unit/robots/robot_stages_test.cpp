// What every robot's kinematics, view and errors must hold: the same tests for both, by type.
#include <gtest/gtest.h>

#include <complex>

#include "equipoise/control/friction.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mbbr/scheduled_feedback.hpp"
#include "robots/mip/config.hpp"
#include "robots/mip/lqr_feedback.hpp"

namespace equipoise {
namespace {

template <class Robot>
class RobotStages : public testing::Test {
 protected:
  using Input = Vec<Robot::kInputs>;
  using Wheels = Vec<Robot::kWheels>;
  typename Robot::Parameters parameters;
  typename Robot::Kinematics kinematics{parameters};
};

using Robots = testing::Types<Mbbr, Mip>;
TYPED_TEST_SUITE(RobotStages, Robots);

TYPED_TEST(RobotStages, WheelsAndAxesAreEachOthersInverse) {
  for (int i = 0; i < TypeParam::kInputs; ++i) {
    const typename TestFixture::Input u = TestFixture::Input::Unit(i);
    EXPECT_LT((this->kinematics.axes_from_wheels(this->kinematics.wheels_from_axes(u)) - u).norm(), 1e-12);
  }
}

TYPED_TEST(RobotStages, FrictionIsCompensatedAlongTheMotionAndNotAtRest) {
  const FrictionCompensation c{0.3, 1.0};
  EXPECT_EQ(
      this->kinematics.friction_input(c, typename TestFixture::Wheels(TestFixture::Wheels::Zero())).norm(),
      0.0);
  for (int i = 0; i < TypeParam::kWheels; ++i) {
    const typename TestFixture::Wheels rates = 10.0 * TestFixture::Wheels::Unit(i);
    const auto wheel_u = this->kinematics.wheels_from_axes(this->kinematics.friction_input(c, rates));
    EXPECT_GT(wheel_u.dot(rates), 0.0) << "wheel " << i;
  }
}

TYPED_TEST(RobotStages, TruthHasNoError) {
  const typename TypeParam::Estimate x{};
  const StateView v = view(x, this->parameters);
  const StateErrors e = errors(v, v, this->parameters);
  EXPECT_EQ(e.attitude_squared, 0.0);
  EXPECT_EQ(e.speed_squared, 0.0);
  EXPECT_GE(e.axes, 1);
  EXPECT_TRUE(v.theta_rad.isZero(0.0));
}

auto reference_of(const Mbbr&, const Overrides& set) {
  return load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", set).config.reference;
}
auto reference_of(const Mip&, const Overrides& set) {
  return load_mip(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml", set).config.reference;
}

TYPED_TEST(RobotStages, JerkAndAccelerationAreThoseThatTheRobotCanFollow) {
  const auto limits = [](const Overrides& set) { return reference_of(TypeParam{}, set); };
  const auto of_the_robot = limits({"reference.max_jerk_m_s3=1e9"});
  const double falls_1_s = of_the_robot.max_jerk_m_s3 / of_the_robot.feasible_acceleration_m_s2;
  EXPECT_GT(falls_1_s, 2.0);
  EXPECT_LT(falls_1_s, 15.0);
  const std::string half = std::to_string(0.5 * this->parameters.k1);
  const auto weak = limits({"reference.max_jerk_m_s3=1e9", "robot.k1_N_m=" + half});
  EXPECT_NEAR(weak.feasible_acceleration_m_s2, 0.5 * of_the_robot.feasible_acceleration_m_s2, 1e-3);
  EXPECT_NEAR(weak.max_jerk_m_s3, 0.5 * of_the_robot.max_jerk_m_s3, 1e-2);
  EXPECT_EQ(limits({"reference.max_jerk_m_s3=0.05"}).max_jerk_m_s3, 0.05) << "who asks for less gets less";
}

TEST(MipReference, ARobotThatIsHeldDoesNotStoreUpALeap) {
  MipReferenceParams p;
  p.max_phi_error_rad = 6.0;
  MipReferenceStage stage(p);
  stage.reset(MipEstimate{});
  Command forwards;
  forwards.velocity_W_m_s.x() = 0.2;
  MipReference ref;
  for (int k = 0; k < 60 * 200; ++k) ref = stage.update(forwards, MipEstimate{});  // it does not move
  EXPECT_DOUBLE_EQ(ref.d_phi, 6.0);
}

TEST(MipLqrFeedback, ItsNextAnswerBeginsWithWhatTheLimitLetThrough) {
  MipLqrParams p;
  p.gains.lqr = {-10.0, 0.0, 0.0, 0.0, 0.5};
  p.max_u = 1.0;
  p.soft_start_s = 0.0;
  MipLqrFeedback feedback(p);
  MipReference ref;
  ref.restart = true;
  ref.d_theta = -3.0;  // asks for 30
  EXPECT_DOUBLE_EQ(feedback.update(ref).x(), 1.0);
  EXPECT_DOUBLE_EQ(feedback.update(MipReference{}).x(), 0.5);
}

/// At a constant speed beside a turn, upright, nothing accelerates the body: u from the linear model.
TEST(MbbrScheduledFeedback, HoldsASteadySpeedInATurn) {
  const MbbrParameters robot;
  MbbrScheduledFeedbackParams p;
  p.gains = design_mbbr(robot, MbbrDesignParams{});
  for (const double yaw_rate : {0.0, 1.0, -2.0, 4.0}) {
    const MbbrLinear s = mbbr_linear(robot, yaw_rate);
    MbbrReference ref;
    ref.yaw_rate = yaw_rate;
    ref.phi_dot_star = Vec2(3.0, -1.0);
    const Vec3 u = MbbrScheduledFeedback(p).update(ref);
    const std::complex<double> held = -s.A(2, 3) / s.b(2, 0) * std::complex<double>(3.0, -1.0);
    EXPECT_NEAR(u.x(), held.real(), 1e-6 + 1e-3 * std::abs(held)) << yaw_rate;
    EXPECT_NEAR(u.y(), held.imag(), 1e-6 + 1e-3 * std::abs(held)) << yaw_rate;
  }
}

TEST(MipKinematics, EncodersGiveMeanAngleAndYaw) {
  const MipParameters p;
  const MipKinematics k(p);
  const Vec2 wheels = k.wheels(1.5, 0.4);
  EXPECT_NEAR(k.phi(wheels), 1.5, 1e-12);
  EXPECT_NEAR(k.psi(wheels), 0.4, 1e-12);
  EXPECT_NEAR(wheels.x() - wheels.y(), 0.4 * p.d / p.r, 1e-12);  // [T] (3.18)
  EXPECT_NEAR(k.phi(k.wheels_of_turn(3.0)), 0.0, 1e-12);
  EXPECT_NEAR(k.psi(k.wheels_of_turn(3.0)), 3.0, 1e-12);
}

}  // namespace
}  // namespace equipoise
