// A wheel encoder that is stuck or reversed is found on both robots, without shaking the wheels: soon after
// arming motors go off and the wheel is named, later the robot runs without it. Healthy encoders never are.
#include <gtest/gtest.h>

#include "support/trial.hpp"

namespace equipoise {
namespace {

constexpr int kSeeds = 20;
constexpr std::uint32_t kWithoutWheels = kWithoutWheelOne | kWithoutWheelTwo | kWithoutWheelThree;

template <class Firmware>
class EncoderCheckOnRobot : public testing::Test {
 protected:
  static app::Choice choice(const std::string& controller) {
    return {Firmware::kDefaultEstimator, controller, "nominal", false, ""};
  }
  static constexpr std::size_t kWheels = Firmware::Robot::kWheels;

  /// Its encoder from the start.
  static TrialEnd stuck(std::size_t wheel, std::uint64_t seed, double drive_m_s) {
    return run_trial<Firmware>(
        choice(Firmware::kDefaultController), seed, 10.0,
        [&](RawSample& raw) { raw.encoder_counts[wheel] = 17.0; }, {}, drive_m_s);
  }
};

using Robots = testing::Types<MbbrFirmware, MipFirmware>;
TYPED_TEST_SUITE(EncoderCheckOnRobot, Robots);

/// The robot does not run on the wheel's word: motors off, or it runs without the encoder. True where the
/// wheel is named.
template <class Firmware>
bool safe_and_named(const TrialEnd& end, std::uint32_t reason, std::size_t wheel, std::uint64_t seed) {
  SCOPED_TRACE("wheel " + std::to_string(wheel) + " seed " + std::to_string(seed) + " reasons " +
               std::to_string(end.reasons));
  if (end.arm_state == ArmState::kFault)
    return (end.reasons & reason) != 0 && (end.reasons & (kWheelOne << wheel)) != 0;
  const std::uint32_t beside = reason == kEncoderStuck ? kWithoutGyroAxis | kGyroBiasJumped : 0U;
  EXPECT_EQ(end.degraded & ~beside, kWithoutWheelOne << wheel);
  return true;
}

/// The eduMIP's soft wheel loop moves it so little that an encoder counts for up to six seconds before it
/// says more than a wheel in its play, and rolling straight on, one wheel says what the other does: both are
/// named.
TYPED_TEST(EncoderCheckOnRobot, FindsAReversedEncoderAndNamesTheWheel) {
  int unnamed = 0;
  for (std::size_t wheel = 0; wheel < this->kWheels; ++wheel) {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const TrialEnd end = run_trial<TypeParam>(this->choice(TypeParam::kDefaultController), seed, 6.0,
                                                [&](RawSample& raw) { raw.encoder_counts[wheel] *= -1.0; });
      unnamed += safe_and_named<TypeParam>(end, kEncoderSign, wheel, seed) ? 0 : 1;
    }
  }
  EXPECT_LE(unnamed, 1);
}

/// A robot that stands gives an encoder next to nothing to count. The eduMIP then stands on with it; what is
/// named is the right wheel.
TYPED_TEST(EncoderCheckOnRobot, StandsSafelyOnAStuckEncoder) {
  int unnamed = 0;
  for (std::size_t wheel = 0; wheel < this->kWheels; ++wheel) {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const TrialEnd end = this->stuck(wheel, seed, 0.0);
      EXPECT_LT(end.most_tilt_rad, 0.3) << "wheel " << wheel << " seed " << seed;
      const bool stands_on = end.arm_state == ArmState::kArmed && (end.degraded & kWithoutWheels) == 0U;
      unnamed += !stands_on && safe_and_named<TypeParam>(end, kEncoderStuck, wheel, seed) ? 0 : 1;
    }
  }
  if (this->kWheels == 3) {
    EXPECT_LE(unnamed, 3 * kSeeds / 5);
  }
}

TYPED_TEST(EncoderCheckOnRobot, FindsAStuckEncoderOnADriveAndNamesTheWheel) {
  int gyro_too = 0;  // a healthy axis may be excluded, or a bias found, beside the wheel
  int unnamed = 0;   // the motors are off, but for what the encoder makes of the torques
  for (std::size_t wheel = 0; wheel < this->kWheels; ++wheel) {
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const TrialEnd end = this->stuck(wheel, seed, 0.2);
      unnamed += safe_and_named<TypeParam>(end, kEncoderStuck, wheel, seed) ? 0 : 1;
      gyro_too += (end.degraded & (kWithoutGyroAxis | kGyroBiasJumped)) != 0 ? 1 : 0;
    }
  }
  EXPECT_LE(gyro_too, static_cast<int>(this->kWheels) * kSeeds / 10);
  EXPECT_LE(unnamed, static_cast<int>(this->kWheels) * kSeeds / 20);
}

TEST(LostEncoder, TheBallBalancerRunsOnWithoutIt) {
  const app::Choice choice{"ekf", "scheduled", "nominal", false, ""};
  for (const int from_tick : {1, 600}) {  // before it arms, and in motion
    for (std::size_t wheel = 0; wheel < 3; ++wheel) {
      int tick = 0;
      double stuck = 0.0;
      const auto interfere = [&](RawSample& raw) {
        if (++tick <= from_tick) stuck = raw.encoder_counts[wheel];
        raw.encoder_counts[wheel] = stuck;
      };
      const TrialEnd end = run_trial<MbbrFirmware>(choice, 7, 12.0, interfere);
      EXPECT_EQ(end.arm_state, ArmState::kArmed)
          << "wheel " << wheel << " from " << from_tick << " reasons " << end.reasons;
      EXPECT_EQ(end.degraded, kWithoutWheelOne << wheel) << "from " << from_tick;
    }
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
    // Wheels in the air do not do what the gyro says: the detector may be first.
    EXPECT_TRUE(end.reasons & (kPickedUp | kImuUntrusted)) << controller << " reasons " << end.reasons;
  }
}

}  // namespace
}  // namespace equipoise
