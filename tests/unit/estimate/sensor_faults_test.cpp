// The parts of the fault detector alone, and its rate of false alarms on a robot whose noise is what it takes
// it for. Robots with faults: tests/scenario.
#include "equipoise/estimate/sensor_faults.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "robots/mbbr/config.hpp"
#include "robots/mbbr/ekf.hpp"
#include "robots/mip/config.hpp"
#include "robots/mip/estimators.hpp"

namespace equipoise {
namespace {

using Sample = Mbbr::Sample;
using Detector = SensorFaults<MbbrEkf, 3>;

Sample at_rest() {
  Sample z;
  z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
  z.wheel_angle_rad = Vec3(1.0, 2.0, 3.0);
  z.gyro_B_rad_s = Vec3(0.1, 0.2, 0.3);
  z.imu_ok = z.encoders_ok = true;
  return z;
}

TEST(FaultHypotheses, EveryEncoderPairAndAxisHasItsOwn) {
  constexpr auto three = fault_hypotheses<3>();
  int kinds[FaultHypothesis::kEvent + 1] = {};
  for (const FaultHypothesis& h : three) {
    ++kinds[h.kind];
    EXPECT_EQ(h.healthy(), h.kind >= FaultHypothesis::kSpin) << h.kind;
    EXPECT_EQ(h.wiring(), h.kind == FaultHypothesis::kReversed || h.kind == FaultHypothesis::kSwap) << h.kind;
  }
  EXPECT_EQ(kinds[FaultHypothesis::kWheel], 3);
  EXPECT_EQ(kinds[FaultHypothesis::kReversed], 3);
  EXPECT_EQ(kinds[FaultHypothesis::kWheels], 3);
  EXPECT_EQ(kinds[FaultHypothesis::kAxis], 3);
  EXPECT_EQ(kinds[FaultHypothesis::kSwap], 3);
  for (int kind = FaultHypothesis::kBias; kind <= FaultHypothesis::kNoise; ++kind) EXPECT_EQ(kinds[kind], 1);
  EXPECT_EQ(kinds[FaultHypothesis::kRock], 0);  // a robot on two wheels rocks
  EXPECT_EQ(fault_hypotheses<2>().size(), 2U + 2U + 1U + 3U + 3U + 7U + 2U);
}

TEST(FaultHypotheses, HaveTheirNamesByOneTableForEveryRobot) {
  const auto name = [](std::int32_t row) { return std::string(kFaultNames[static_cast<std::size_t>(row)]); };
  constexpr auto mbbr = fault_rows<3>();
  constexpr auto edumip = fault_rows<2>();
  std::string names;
  for (const std::int32_t row : mbbr) names += name(row) + " ";
  EXPECT_EQ(names,
            "encoder_1 encoder_2 encoder_3 encoder_1_reversed encoder_2_reversed encoder_3_reversed "
            "encoders_1_2 encoders_1_3 encoders_2_3 gyro_x gyro_y gyro_z gyro_x_y_swapped gyro_y_z_swapped "
            "gyro_z_x_swapped gyro_bias imu spin slip push imu_noise gyro_drift ");
  EXPECT_EQ(name(edumip[4]), "encoders_1_2");
  EXPECT_EQ(name(edumip.back()), "gyro_drift");
  EXPECT_EQ(name(edumip[edumip.size() - 2]), "event");
  EXPECT_EQ(name(edumip[edumip.size() - 4]), "imu_noise");
}

TEST(UsedSensors, SayWhichVerdictsTheyAreReadBy) {
  const auto bit = [](const FaultHypothesis& h) {
    return h.kind == FaultHypothesis::kWheel ? h.mask : h.kind == FaultHypothesis::kAxis ? h.mask << 14U : 0U;
  };
  UsedSensors<3> used;
  EXPECT_EQ(used.verdicts(), 0U);
  for (const FaultHypothesis& h :
       {FaultHypothesis{FaultHypothesis::kWheel, 0b010}, {FaultHypothesis::kAxis, 0b100}}) {
    EXPECT_EQ(used.turned_over(h).verdicts(), bit(h));
    EXPECT_EQ(used.turned_over(h).turned_over(h).verdicts(), 0U) << "taken back";
  }
  EXPECT_EQ(used.turned_over({FaultHypothesis::kWheels, 0b101}).verdicts(), 0b101U);
  EXPECT_EQ(used.turned_over({FaultHypothesis::kSwap, 0b110}).verdicts(), 1U << 18U);
  used.without_wheels = used.backwards = 0b100;
  EXPECT_EQ(used.verdicts(), 1U << 6U) << "not the encoder's own, too";
  used.bias_rad_s.x() = 0.2;
  EXPECT_EQ(used.verdicts(), 1U << 6U | 1U << 20U);
  const FaultHypothesis drift{FaultHypothesis::kDrift, 0};
  EXPECT_EQ(used.turned_over(drift).verdicts(), 1U << 6U | 1U << 20U | 1U << 28U);
  EXPECT_EQ(used.turned_over(drift).turned_over(drift).verdicts(), used.verdicts()) << "steady again";
}

TEST(UsedSensors, ReadWhatIsWrongTheOtherWayRound) {
  const Sample z = at_rest();
  UsedSensors<3> used;
  EXPECT_EQ(used.of(z).gyro_B_rad_s, z.gyro_B_rad_s);
  used = UsedSensors<3>{}.turned_over({FaultHypothesis::kSwap, 0b110});
  EXPECT_EQ(used.of(z).gyro_B_rad_s, Vec3(0.1, 0.3, 0.2));
  used = UsedSensors<3>{}.turned_over({FaultHypothesis::kSwap, 0b101});
  EXPECT_EQ(used.of(z).gyro_B_rad_s, Vec3(0.3, 0.2, 0.1));
  used.swap_sign = -1.0;  // x along the body's x, z against its z
  EXPECT_EQ(used.of(z).gyro_B_rad_s, Vec3(-0.3, 0.2, -0.1));
  used = UsedSensors<3>{}.turned_over({FaultHypothesis::kReversed, 0b010});
  used.mirror_rad = 1.5;
  EXPECT_EQ(used.of(z).wheel_angle_rad, Vec3(1.0, 1.0, 3.0));
  used = UsedSensors<3>{}.turned_over({FaultHypothesis::kWheels, 0b101});
  EXPECT_FALSE(used.of(z).wheel_ok[0]);
  EXPECT_TRUE(used.of(z).wheel_ok[1]);
  EXPECT_FALSE(used.of(z).wheel_ok[2]);
  used = UsedSensors<3>{}.turned_over({FaultHypothesis::kImu, 0});
  EXPECT_FALSE(used.of(z).imu_ok);
}

TEST(UsedSensors, AnExcludedSensorMayReturn) {
  const FaultHypothesis wheel{FaultHypothesis::kWheel, 0b100};
  const UsedSensors<3> without = UsedSensors<3>{}.turned_over(wheel);
  EXPECT_FALSE(without.of(at_rest()).wheel_ok[2]);
  EXPECT_TRUE(without.turned_over(wheel).of(at_rest()).wheel_ok[2]);
}

class Standing : public testing::Test {
 protected:
  MbbrConfig config = load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", {}).config;
  MbbrEkf control{config.robot, config.estimators.ekf};
  std::mt19937 random{7};
  std::normal_distribution<double> normal;
  double gyro_sigma_rad_s = 0.0015;

  static SensorFaultsParams params() {
    SensorFaultsParams p;
    p.evidence = {0.012, 2.0 * kPi / 720.0, 0.15, 0.5};  // as the MBBR's
    p.bias_drifts = true;
    p.balances = {true, true, false};
    return p;
  }
  Sample sample() {
    Sample z = at_rest();
    z.gyro_B_rad_s = gyro_sigma_rad_s * Vec3(normal(random), normal(random), normal(random));
    z.accel_B_m_s2 += 0.05 * Vec3(normal(random), normal(random), normal(random));
    return z;
  }
  Detector armed() {
    control.start(Vec2::Zero(), Vec3::Zero(), at_rest().wheel_angle_rad);
    Detector detector(control, params());
    detector.reset(control, gyro_sigma_rad_s);
    return detector;
  }
};

TEST_F(Standing, AVerdictDoesNotWaitWhileTheControlMakesItWorse) {
  const auto urgent = [this](double turns_rad_s, double believed_rad_s) {
    Sample z = at_rest();
    z.gyro_B_rad_s = Vec3(turns_rad_s, 0.0, 0.0);
    control.start_moving(Vec2::Zero(), Vec3::Zero(), z);
    return FaultMember<MbbrEkf, 3>{control}.is_urgent(Vec3(believed_rad_s, 0.0, 0.0), 20);
  };
  EXPECT_TRUE(urgent(7.0, 0.5)) << "0.65 rad in 0.1 s";
  EXPECT_FALSE(urgent(7.0, 1.5)) << "the control brakes it, if not enough";
  EXPECT_TRUE(urgent(-5.0, 1.5)) << "it drives it";
  EXPECT_FALSE(urgent(-5.0, 0.5));
  EXPECT_FALSE(urgent(1.0, 9.0)) << "it brakes what is not there";
}

/// A ratio of likelihoods exceeds e^h with a chance of e^-h at most, whatever the model (Ville 1939); its sum
/// since it was last refuted starts anew at most every tick.
TEST_F(Standing, RatiosOfAHealthyRobotAreRarerThanTheoryAllows) {
  Detector detector = armed();
  constexpr int kTicks = 6000;
  std::array<int, 3> beyond{};  // 4, 8, 12 nats
  int shown = 0;                // more than 4 to whoever looks
  for (int tick = 0; tick < kTicks; ++tick) {
    detector.step(control, Vec3::Zero(), sample(), Vec3::Zero());
    double most = 0.0;
    for (std::size_t i = 0; i < Detector::kCount; ++i)
      if (!Detector::kHypotheses[i].healthy()) most = std::max(most, detector.ratio(i));
    shown += detector.evidence().ratio > 4.0;
    for (std::size_t i = 0; i < 3; ++i) beyond[i] += most > 4.0 * static_cast<double>(i + 1);
  }
  EXPECT_TRUE(detector.trusted());
  EXPECT_EQ(detector.excluded_wheels(), 0U);
  EXPECT_LT(shown, kTicks / 20);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LE(beyond[i],
              kTicks * static_cast<double>(Detector::kCount) * std::exp(-4.0 * static_cast<double>(i + 1)));
}

TEST_F(Standing, NoiseThatGrowsIsNoFault) {
  Detector detector = armed();
  for (int tick = 0; tick < 2000; ++tick) {
    gyro_sigma_rad_s = tick < 400 ? 0.0015 : 0.1;
    detector.step(control, Vec3::Zero(), sample(), Vec3::Zero());
  }
  EXPECT_TRUE(detector.trusted());
  EXPECT_FALSE(detector.gyro_axis_excluded());
  EXPECT_EQ(detector.bias_jumps(), 0);
}

/// With less weight on its gyro an MBBR follows wheels that slip.
TEST_F(Standing, ControlTakesABurstForNoiseAndFollowsWhatVibrates) {
  for (const double sigma_rad_s : {0.04, 0.35}) {
    Detector detector = armed();
    const double gyro = control.row_noise(0);
    const double accel = control.row_noise(6);
    int noisier = 0;  // ticks, of 0.3 s
    for (int tick = 0; tick < 460; ++tick) {
      const bool shaken = tick >= 400;
      gyro_sigma_rad_s = shaken ? sigma_rad_s : 0.0015;
      Sample z = sample();
      if (shaken) z.accel_B_m_s2 += 14.0 * sigma_rad_s * Vec3(normal(random), normal(random), normal(random));
      detector.step(control, Vec3::Zero(), z, Vec3::Zero());
      ASSERT_EQ(control.row_noise(0) > gyro, control.row_noise(6) > accel) << tick;
      noisier += control.row_noise(0) > gyro ? 1 : 0;
    }
    if (sigma_rad_s < 0.1)
      EXPECT_EQ(noisier, 0);
    else
      EXPECT_GE(noisier, 10);
    detector.reset(control, 0.0015);
    detector.step(control, Vec3::Zero(), at_rest(), Vec3::Zero());
  }
}

TEST_F(Standing, ABiasThatJumpsIsTakenOff) {
  Detector detector = armed();
  int found = 0;
  for (int tick = 0; tick < 600; ++tick) {
    Sample z = sample();
    if (tick >= 400) z.gyro_B_rad_s += Vec3(0.3, -0.25, 0.2);
    detector.step(control, Vec3::Zero(), z, Vec3::Zero());
    if (detector.bias_jumps() == 0) continue;
    if (found == 0) found = tick;
    EXPECT_LT(control.estimate().omega_B.norm(), 0.05) << "from its first tick on, " << tick - found;
  }
  EXPECT_GE(found, 400);
  EXPECT_LE(found, 460) << "0.2 s, and 0.1 s in which it leads: 0.3 rad/s make 0.09 rad of it";
  EXPECT_TRUE(detector.trusted());
}

/// 0.2 rad/s more each second, for three seconds.
TEST_F(Standing, ABiasThatDriftsIsFollowedWhileItDoes) {
  constexpr std::uint32_t kBit = 1U << 28;  // gyro_drift
  Detector detector = armed();
  int found = 0;
  for (int tick = 0; tick < 8000; ++tick) {
    Sample z = sample();
    z.gyro_B_rad_s.x() += 0.001 * std::clamp(tick - 400, 0, 600);
    detector.step(control, Vec3::Zero(), z, Vec3(z.gyro_B_rad_s.x(), 0.0, 0.0));
    if (found == 0 && detector.evidence().verdicts == kBit) found = tick;
    ASSERT_TRUE(detector.trusted()) << tick;
    ASSERT_LT(control.estimate().theta_xy.norm(), 0.2) << tick;
  }
  EXPECT_GT(found, 400);
  EXPECT_LT(found, 700) << "1.5 s";
  EXPECT_EQ(detector.evidence().verdicts, 0U) << "steady again";
  EXPECT_NEAR(control.gyro_bias(0), 0.6, 0.02);
}

TEST_F(Standing, AVerdictSaysWhatLedAndByHowMuch) {
  constexpr std::int32_t kRow = 20;  // gyro_bias
  Detector detector = armed();
  EXPECT_EQ(detector.evidence().leading, -1);
  EXPECT_GT(detector.evidence().bound, 0.0);
  std::vector<FaultEvidence> decided;
  int beyond = 0;  // ticks
  for (int tick = 0; tick < 600 && decided.empty(); ++tick) {
    Sample z = sample();
    if (tick >= 400) z.gyro_B_rad_s += Vec3(0.3, -0.25, 0.2);
    detector.step(control, Vec3::Zero(), z, Vec3::Zero());
    const FaultEvidence& e = detector.evidence();
    ASSERT_GE(e.leading, 0);
    ASSERT_NE(e.leading, e.runner_up);
    ASSERT_GT(e.ratio, -5.0) << "what is refuted does not lead";
    ASSERT_EQ(e.decided, detector.bias_jumps() > 0);
    if (e.decided) decided.push_back(e);
    if (!e.decided) {
      ASSERT_EQ(e.verdicts, 0U);
    }
    beyond = e.leading == kRow && e.ratio > e.bound ? beyond + 1 : 0;
  }
  ASSERT_EQ(decided.size(), 1U);
  const FaultEvidence verdict = decided[0];
  EXPECT_EQ(verdict.leading, kRow);
  EXPECT_GT(verdict.ratio, verdict.bound);
  EXPECT_GE(beyond, 20) << "so long it leads first";
  EXPECT_GE(verdict.ratio - verdict.runner_up_ratio, 5.0) << "the margin";
  EXPECT_EQ(verdict.verdicts, 1U << kRow);
  detector.step(control, Vec3::Zero(), sample(), Vec3::Zero());
  EXPECT_FALSE(detector.evidence().decided) << "once";
  EXPECT_EQ(detector.evidence().verdicts, 1U << kRow);
  detector.reset(control, gyro_sigma_rad_s);
  EXPECT_EQ(detector.evidence().verdicts, 1U << kRow) << "a reader that misses ticks sees why it is disarmed";
  EXPECT_EQ(detector.evidence().leading, -1);
  detector.step(control, Vec3::Zero(), sample(), Vec3::Zero());
  EXPECT_EQ(detector.evidence().verdicts, 0U);
}

/// The robot does not balance without its x axis.
TEST_F(Standing, WhatStopsTheRobotIsAVerdictOnce) {
  Detector detector = armed();
  int decided = 0;
  for (int tick = 0; tick < 800; ++tick) {
    Sample z = sample();
    if (tick >= 400) z.gyro_B_rad_s.x() = tick % 2 == 0 ? 1.5 : -1.5;
    detector.step(control, Vec3::Zero(), z, Vec3::Zero());
    decided += detector.evidence().decided && !detector.trusted() ? 1 : 0;
    if (!detector.trusted()) {
      ASSERT_NE(detector.evidence().verdicts, 0U) << tick;
    }
  }
  ASSERT_FALSE(detector.trusted());
  EXPECT_EQ(decided, 1);
}

TEST_F(Standing, ABlowIsNoBias) {
  for (const int ticks : {15, 100}) {
    Detector detector = armed();
    for (int tick = 0; tick < 600; ++tick) {
      Sample z = sample();
      if (tick >= 400 && tick < 400 + ticks) z.gyro_B_rad_s += Vec3::Constant(0.3);
      detector.step(control, Vec3::Zero(), z, Vec3::Zero());
    }
    EXPECT_EQ(detector.bias_jumps() > 0, ticks == 100);
  }
}

/// It rolls to and fro. With its axes swapped a robot that stands would not turn, and one that rolls would.
TEST(Rocking, IsNoSwapOfAxes) {
  const MipConfig config = load_mip(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml", {}).config;
  MipEstimators estimators(config.estimators);
  std::mt19937 random{7};
  std::normal_distribution<double> normal(0.0, 0.0015);
  Mip::Sample z;
  z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
  z.wheel_angle_rad.setZero();
  z.imu_ok = z.encoders_ok = true;
  for (int tick = 0; tick < 1200; ++tick) {
    z.gyro_B_rad_s = Vec3(normal(random), normal(random), normal(random));
    if (tick >= 600) z.gyro_B_rad_s.y() += 0.8 * std::sin(2.0 * kPi * tick / 60.0);
    estimators.update(z, Vec2::Zero(), tick < 200);
    EXPECT_EQ(estimators.health().evidence.verdicts >> fault_rows<2>()[9] & 1U, 0U) << tick;
  }
}

TEST(Detection, BeginsWithTheMotionThatTheControlBeginsWith) {
  const MipConfig config = load_mip(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml", {}).config;
  MipEstimators estimators(config.estimators);
  Mip::Sample z;
  z.accel_B_m_s2 = Vec3(0.0, 0.0, -kGravity_m_s2);
  z.gyro_B_rad_s = Vec3(1.0, 0.0, 0.0);
  z.wheel_angle_rad.setZero();
  z.wheel_rate_rad_s = MipKinematics(config.robot).wheels(8.0, 0.0);
  z.imu_ok = z.encoders_ok = true;
  estimators.start_moving(Vec2::Zero(), Vec3::Zero(), z);
  for (int tick = 0; tick < 20; ++tick) {
    z.wheel_angle_rad += kTickS * z.wheel_rate_rad_s;
    estimators.update(z, Vec2::Zero(), false);
    EXPECT_LT(estimators.health().evidence.ratio, 5.0) << tick;
  }
}

/// The control's filter goes on as if there were no detector.
TEST_F(Standing, NothingIsWeighedWithoutOneKindOfSensor) {
  gyro_sigma_rad_s = 0.0005;  // less than what the control's filter takes it for anyway
  Detector detector = armed();
  MbbrEkf alone = control;
  for (int tick = 0; tick < 600; ++tick) {
    Sample z = sample();
    z.imu_ok = tick < 400;
    if (tick >= 400) z.wheel_angle_rad += 0.05 * (tick - 400) * Vec3(1.0, -1.0, 0.0);
    detector.step(control, Vec3::Zero(), z, Vec3::Zero());
    alone.predict(Vec3::Zero());
    alone.update(z);
    ASSERT_EQ(control.x(), alone.x()) << tick;
  }
  EXPECT_TRUE(detector.trusted());
  EXPECT_EQ(detector.excluded_wheels(), 0U);
}

}  // namespace
}  // namespace equipoise
