// A wheel encoder that is stuck or reversed is found within half a second of arming, on both robots: motors
// off, the wheel named. And healthy encoders never are.
#include <gtest/gtest.h>

#include "support/trial.hpp"

namespace equipoise {
namespace {

constexpr int kSeeds = 20;

template <class Firmware>
class EncoderCheckOnRobot : public testing::Test {
 protected:
  static app::Choice choice(const std::string& controller) {
    return {Firmware::kDefaultEstimator, controller, "nominal", false, ""};
  }
  static constexpr std::size_t kWheels = Firmware::Robot::kWheels;
};

using Robots = testing::Types<app::MbbrFirmware, app::MipFirmware>;
TYPED_TEST_SUITE(EncoderCheckOnRobot, Robots);

TYPED_TEST(EncoderCheckOnRobot, FindsAReversedEncoderAndNamesTheWheel) {
  for (std::size_t wheel = 0; wheel < this->kWheels; ++wheel) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const TrialEnd end = run_trial<TypeParam>(this->choice(TypeParam::kDefaultController), seed, 2.0,
                                                [&](RawSample& raw) { raw.encoder_counts[wheel] *= -1.0; });
      EXPECT_EQ(end.arm_state, ArmState::kFault) << "wheel " << wheel << " seed " << seed;
      EXPECT_TRUE(end.reasons & kEncoderSign) << "wheel " << wheel << " seed " << seed;
      EXPECT_TRUE(end.reasons & (kWheelOne << wheel)) << "wheel " << wheel << " seed " << seed;
      EXPECT_LE(end.ended_at_s, 0.5);
    }
  }
}

TYPED_TEST(EncoderCheckOnRobot, FindsAStuckEncoderAndNamesTheWheel) {
  for (std::size_t wheel = 0; wheel < this->kWheels; ++wheel) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const TrialEnd end = run_trial<TypeParam>(this->choice(TypeParam::kDefaultController), seed, 2.0,
                                                [&](RawSample& raw) { raw.encoder_counts[wheel] = 17.0; });
      EXPECT_EQ(end.arm_state, ArmState::kFault) << "wheel " << wheel << " seed " << seed;
      EXPECT_TRUE(end.reasons & kEncoderStuck) << "wheel " << wheel << " seed " << seed;
      EXPECT_TRUE(end.reasons & (kWheelOne << wheel)) << "wheel " << wheel << " seed " << seed;
      EXPECT_LE(end.ended_at_s, 0.5);
    }
  }
}

TYPED_TEST(EncoderCheckOnRobot, LeavesHealthyEncodersAlone) {
  for (const std::string& controller : TypeParam::controllers()) {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const TrialEnd end = run_trial<TypeParam>(this->choice(controller), seed, 1.0, [](RawSample&) {});
      EXPECT_EQ(end.arm_state, ArmState::kArmed)
          << controller << " seed " << seed << " reasons " << end.reasons;
    }
  }
}

TEST(PickUp, TurnsTheMotorsOffWhenTheWheelsLoseTheGround) {
  for (const std::string controller : {"slc", "lqr"}) {
    const app::Choice choice{"ekf", controller, "nominal", false, ""};
    const TrialEnd end =
        run_trial<app::MipFirmware>(choice, 1, 8.0, [](RawSample&) {}, {"world.nominal.lift_at_s=3.0"});
    EXPECT_EQ(end.arm_state, ArmState::kFault) << controller;
    EXPECT_TRUE(end.reasons & (kPickedUp | kSaturated)) << controller << " reasons " << end.reasons;
  }
}

}  // namespace
}  // namespace equipoise
