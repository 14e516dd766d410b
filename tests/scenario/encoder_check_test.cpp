// A wheel encoder that is stuck or reversed is found on both robots, without shaking the wheels: soon after
// arming motors go off and the wheel is named, later the robot runs without it. Healthy encoders never are.
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

using Robots = testing::Types<MbbrFirmware, MipFirmware>;
TYPED_TEST_SUITE(EncoderCheckOnRobot, Robots);

/// The robot does not run on the wheel's word: motors off and the wheel named, or it runs without the
/// encoder.
template <class Firmware>
void expect_named(const TrialEnd& end, std::uint32_t reason, std::size_t wheel, std::uint64_t seed) {
  SCOPED_TRACE("wheel " + std::to_string(wheel) + " seed " + std::to_string(seed) + " reasons " +
               std::to_string(end.reasons));
  if (end.arm_state == ArmState::kFault) {
    EXPECT_TRUE(end.reasons & reason);
    EXPECT_TRUE(end.reasons & (kWheelOne << wheel));
  } else {
    const std::uint32_t beside = reason == kEncoderStuck ? kWithoutGyroAxis : 0U;
    EXPECT_EQ(end.degraded & ~beside, kWithoutWheelOne << wheel);
  }
}

/// The eduMIP's soft wheel loop moves it so little that its filter makes a gyro bias of the encoder first:
/// the gyro is not judged by that.
TYPED_TEST(EncoderCheckOnRobot, FindsAReversedEncoderAndNamesTheWheel) {
  for (std::size_t wheel = 0; wheel < this->kWheels; ++wheel) {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const TrialEnd end = run_trial<TypeParam>(this->choice(TypeParam::kDefaultController), seed, 2.0,
                                                [&](RawSample& raw) { raw.encoder_counts[wheel] *= -1.0; });
      expect_named<TypeParam>(end, kEncoderSign, wheel, seed);
    }
  }
}

TYPED_TEST(EncoderCheckOnRobot, FindsAStuckEncoderAndNamesTheWheel) {
  int gyro_too = 0;   // the gyro watch may exclude a healthy axis beside the wheel
  int unnoticed = 0;  // on a robot that stands so still that the encoder has nothing to count
  for (std::size_t wheel = 0; wheel < this->kWheels; ++wheel) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const TrialEnd end = run_trial<TypeParam>(this->choice(TypeParam::kDefaultController), seed, 10.0,
                                                [&](RawSample& raw) { raw.encoder_counts[wheel] = 17.0; });
      if (end.arm_state == ArmState::kArmed && end.degraded == 0U) {
        ++unnoticed;
        continue;
      }
      expect_named<TypeParam>(end, kEncoderStuck, wheel, seed);
      gyro_too += (end.degraded & kWithoutGyroAxis) != 0 ? 1 : 0;
    }
  }
  EXPECT_LE(gyro_too, 1);
  EXPECT_LE(unnoticed, 1);
}

TEST(LostEncoder, TheBallBalancerRunsOnWithoutIt) {
  const app::Choice choice{"ekf", "scheduled", "nominal", false, ""};
  for (std::size_t wheel = 0; wheel < 3; ++wheel) {
    int tick = 0;
    double stuck = 0.0;
    const auto interfere = [&](RawSample& raw) {
      if (++tick < 600) stuck = raw.encoder_counts[wheel];
      raw.encoder_counts[wheel] = stuck;
    };
    const TrialEnd end = run_trial<MbbrFirmware>(choice, 7, 12.0, interfere);
    EXPECT_EQ(end.arm_state, ArmState::kArmed) << "wheel " << wheel << " reasons " << end.reasons;
    EXPECT_EQ(end.degraded, kWithoutWheelOne << wheel);
  }
}

TYPED_TEST(EncoderCheckOnRobot, LeavesHealthyEncodersAlone) {
  for (const std::string& controller : TypeParam::controllers()) {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const TrialEnd end = run_trial<TypeParam>(this->choice(controller), seed, 1.0, [](RawSample&) {});
      EXPECT_EQ(end.arm_state, ArmState::kArmed)
          << controller << " seed " << seed << " reasons " << end.reasons;
      EXPECT_EQ(end.degraded, 0U) << controller << " seed " << seed;
    }
  }
}

TEST(PickUp, TurnsTheMotorsOffWhenTheWheelsLoseTheGround) {
  for (const std::string controller : {"slc", "lqr"}) {
    const app::Choice choice{"ekf", controller, "nominal", false, ""};
    const TrialEnd end =
        run_trial<MipFirmware>(choice, 1, 8.0, [](RawSample&) {}, {"world.nominal.lift_at_s=3.0"});
    EXPECT_EQ(end.arm_state, ArmState::kFault) << controller;
    EXPECT_TRUE(end.reasons & (kPickedUp | kSaturated)) << controller << " reasons " << end.reasons;
  }
}

}  // namespace
}  // namespace equipoise
