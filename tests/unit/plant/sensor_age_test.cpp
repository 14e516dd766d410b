// Each sensor reports its own age of the motion, and the PWM takes its duty within the tick.
#include <gtest/gtest.h>

#include "equipoise/plant/delay_line.hpp"
#include "robots/mip/world.hpp"
#include "unit/plant/level_world.hpp"

namespace equipoise {
namespace {

MotorCommand spinning() {
  MotorCommand command{};
  command.enable = true;
  for (double& duty : command.duty) duty = 0.9;
  return command;
}

/// The sample after `ticks` of spinning up.
RawSample mbbr_sample(const MbbrWorldParams& params, int ticks) {
  MbbrWorld world(MbbrParameters(), MotorParameters(), Calibration(), params);
  RawSample raw = world.sense();
  for (int i = 0; i < ticks; ++i) {
    world.advance(spinning());
    raw = world.sense();
  }
  return raw;
}

TEST(ImuParts, DelaysOfTheMpuAreThoseOfItsRegisterMap) {
  EXPECT_EQ(imu_low_pass(0, 2)->gyro_delay_s, 3.9e-3);
  EXPECT_EQ(imu_low_pass(0, 2)->accel_delay_s, 2.88e-3);
  EXPECT_EQ(imu_low_pass(0, 6)->gyro_delay_s, 33.48e-3);
  EXPECT_EQ(imu_low_pass(0, 7)->gyro_delay_s, 0.0);
  EXPECT_EQ(imu_low_pass(0, -1)->accel_delay_s, 0.0);
}

/// Whatever the part: a wider filter is an earlier one; where the sheet tells no delay, it is sqrt(2) / (2 pi
/// f).
TEST(ImuParts, DelayFollowsBandwidth) {
  for (int part = 0; part < IMU_PARTS; ++part) {
    const bool told = std::string(imu_part(part)->name).rfind("mpu", 0) == 0;
    for (int i = 1; i <= IMU_LOW_PASS_MAX && imu_low_pass(part, i)->gyro_hz > 0.0; ++i) {
      const imu_low_pass_t& low_pass = *imu_low_pass(part, i);
      SCOPED_TRACE(std::string(imu_part(part)->name) + " " + std::to_string(i));
      const imu_low_pass_t& before = *imu_low_pass(part, i - 1);
      if (i > 1) {
        EXPECT_EQ(before.gyro_hz > low_pass.gyro_hz, before.gyro_delay_s < low_pass.gyro_delay_s);
      }
      if (told) continue;
      EXPECT_NEAR(low_pass.gyro_delay_s, std::sqrt(2.0) / (2.0 * kPi * low_pass.gyro_hz), 1e-5);
      EXPECT_NEAR(low_pass.accel_delay_s, std::sqrt(2.0) / (2.0 * kPi * low_pass.accel_hz), 1e-5);
      EXPECT_GE(low_pass.rate_hz, 2.0 * std::max(low_pass.gyro_hz, low_pass.accel_hz) - 1.0)
          << "above its Nyquist rate";
    }
  }
}

/// 0.01 deg/s and 300 ug per root Hz over 92 and 99 Hz: what robots measured with this chip is near it.
TEST(ImuParts, NoiseOfTheMpuIsThatOfTheConfiguredWorld) {
  EXPECT_NEAR(imu_gyro_sigma_rad_s(0, 2), 0.0014, 0.0004);
  EXPECT_NEAR(imu_accel_sigma_m_s2(0, 2), 0.04, 0.01);
  EXPECT_LT(imu_gyro_sigma_rad_s(2, 1), imu_gyro_sigma_rad_s(0, 2));
}

TEST(DelayLine, IsLinearBetweenRecordsAndHoldsTheFirst) {
  DelayLine line;
  for (int k = 0; k < 400; ++k) {
    Felt felt;
    felt.time_s = 1e-3 * k;
    felt.omega_B_rad_s = Vec3(felt.time_s, 2.0 * felt.time_s, 0.0);
    line.add(felt);
    line.add(felt);  // the same instant, seen again
  }
  for (const double age : {0.0, 0.4e-3, 3.9e-3, 70e-3}) {
    EXPECT_NEAR(line.value(0.399 - age, &Felt::omega_B_rad_s).y(), 2.0 * (0.399 - age), 1e-12) << age;
  }
  DelayLine young;
  young.add({1.0, Vec3::Ones(), Vec3::Zero(), Vec<kMaxMotors>::Zero()});
  EXPECT_EQ(young.value(0.9, &Felt::omega_B_rad_s).x(), 1.0);
}

TEST(SensorAge, TheGyroIsLateByTheLowPassAndTheEncodersAreNot) {
  const RawSample prompt = mbbr_sample(level_world_without_friction(), 8);
  MbbrWorldParams w = level_world_without_friction();
  w.common.imu_low_pass = 2;
  const RawSample late = mbbr_sample(w, 8);
  const RawSample before = mbbr_sample(level_world_without_friction(), 7);
  EXPECT_EQ(late.encoder_counts[0], prompt.encoder_counts[0]);
  EXPECT_EQ(late.t_ns, prompt.t_ns);
  // 3.9 of the tick's 5 ms back; the spin is nearly linear over one tick.
  const double expected = prompt.gyro_counts[2] + 0.78 * (before.gyro_counts[2] - prompt.gyro_counts[2]);
  EXPECT_NEAR(late.gyro_counts[2], expected, 0.01 * std::abs(expected));
  EXPECT_GT(std::abs(late.gyro_counts[2] - prompt.gyro_counts[2]), 0.02 * std::abs(prompt.gyro_counts[2]));
}

TEST(SensorAge, SpreadAndSamplingInstantsAddToIt) {
  MbbrWorldParams w = level_world_without_friction();
  w.common.imu_low_pass = 2;
  w.common.imu_delay_scale = 0.0;
  w.common.imu_sample_age_s = 5e-3;
  w.common.encoder_sample_age_s = 5e-3;
  const RawSample late = mbbr_sample(w, 8);
  const RawSample before = mbbr_sample(level_world_without_friction(), 7);
  EXPECT_NEAR(late.gyro_counts[2], before.gyro_counts[2], 1e-6);
  EXPECT_NEAR(late.encoder_counts[1], before.encoder_counts[1], 1e-6);
  w.common.imu_delay_scale = 1.1;
  EXPECT_NEAR(w.common.gyro_age_s(), 5e-3 + 1.1 * 3.9e-3, 1e-15);
  EXPECT_NEAR(w.common.accel_age_s(), 5e-3 + 1.1 * 2.88e-3, 1e-15);
}

TEST(SensorAge, TheEduMipsGyroIsLateToo) {
  const auto sample = [](const MipWorldParams& params) {
    MipWorld world(MipParameters(), MotorParameters(), Calibration(), params);
    RawSample raw{};
    MotorCommand turn = spinning();
    turn.duty[1] = -turn.duty[1];
    for (int i = 0; i < 8; ++i) {
      world.advance(turn);
      raw = world.sense();
    }
    return raw;
  };
  MipWorldParams w;
  w.common.initial_tilt_rad = 0.0;
  w.common.friction = false;
  const RawSample prompt = sample(w);
  w.common.imu_low_pass = 2;
  const RawSample late = sample(w);
  EXPECT_LT(std::abs(late.gyro_counts[2]), 0.98 * std::abs(prompt.gyro_counts[2]));
  EXPECT_EQ(late.encoder_counts[0], prompt.encoder_counts[0]);
}

TEST(ActuationDelay, AFractionOfATickLiesBetweenItsNeighbours) {
  const auto turned = [](double ticks, int steps) {
    MbbrWorldParams w = level_world_without_friction();
    w.common.actuation_delay_ticks = ticks;
    w.common.actuation_latency_steps = steps;
    MbbrWorld world(MbbrParameters(), MotorParameters(), Calibration(), w);
    for (int i = 0; i < 3; ++i) world.advance(spinning());
    return std::abs(world.truth().theta_z);
  };
  EXPECT_EQ(turned(0.4, 0), turned(0.0, 2));  // two of the five steps
  EXPECT_LT(turned(0.5, 0), turned(0.4, 0));
  EXPECT_GT(turned(0.5, 0), turned(0.6, 0));
  // The command is late by 2.5 of 15 ms; the spin grows with the square of what is left.
  EXPECT_NEAR(turned(0.5, 0) / turned(0.0, 0), std::pow(12.5 / 15.0, 2), 0.02);
}

}  // namespace
}  // namespace equipoise
