// What every robot's kinematics, view and errors must hold: the same tests for both, by type.
#include <gtest/gtest.h>

#include "equipoise/control/friction.hpp"
#include "robots/mbbr/mbbr.hpp"
#include "robots/mip/mip.hpp"

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

TEST(MipKinematics, EncodersGiveMeanAngleAndYaw) {
  const MipParameters p;
  const MipKinematics k(p);
  const Vec2 wheels = k.wheels(1.5, 0.4);
  EXPECT_NEAR(k.phi(wheels), 1.5, 1e-12);
  EXPECT_NEAR(k.psi(wheels), 0.4, 1e-12);
  EXPECT_NEAR(wheels.x() - wheels.y(), 0.4 * p.d / p.r, 1e-12);  // [T] (3.18)
}

}  // namespace
}  // namespace equipoise
