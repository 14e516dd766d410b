// What must not turn motors off: at the limit, or of no concern.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "support/safety_inputs.hpp"

namespace equipoise {
namespace {

/// At the limit, or of no concern to a robot that runs: nothing disarms, however long it lasts.
struct Harmless {
  const char* name;
  std::function<void(SafetyInputs&, MotorCommand&)> cause;
};

const Harmless kHarmless[] = {
    {"tilt", [](SafetyInputs& in, MotorCommand&) { in.state.theta_rad.y() = -0.60; }},
    {"fall", [](SafetyInputs& in, MotorCommand&) { in.state.omega_B_rad_s.x() = 5.0; }},
    {"heading",
     [](SafetyInputs& in, MotorCommand&) {
       in.state.theta_rad.z() = 3.0;
       in.state.omega_B_rad_s.z() = 30.0;
     }},
    {"bias", [](SafetyInputs& in, MotorCommand&) { in.bias_drift_rad_s = 0.1; }},
    {"motors", [](SafetyInputs& in, MotorCommand&) { in.motor_error = 0.75; }},
    {"tilt_sigma", [](SafetyInputs& in, MotorCommand&) { in.tilt_sigma_rad = 0.1; }},
    {"battery", [](SafetyInputs& in, MotorCommand&) { in.battery_V = 6.0; }},
    {"innovation", [](SafetyInputs& in, MotorCommand&) { in.state.normalized_innovation = -2.5; }},
    {"innovation_not_a_number",
     [](SafetyInputs& in, MotorCommand&) { in.state.normalized_innovation = NAN; }},
    {"wheels",
     [](SafetyInputs& in, MotorCommand&) {
       in.wheel_rate_rad_s = {90.0, -90.0, 0.0, 0.0};
     }},
    {"light", [](SafetyInputs& in, MotorCommand&) { in.accel_m_s2 = 0.2 * kGravity_m_s2; }},
    {"full_duty",
     [](SafetyInputs& in, MotorCommand& m) {
       assign(m.duty, {1.0, -1.0, 1.0, -1.0});
       in.wheel_rate_rad_s = {0.5, -0.5, 0.5, 0.5};
     }},
    {"standing_wheels",
     [](SafetyInputs&, MotorCommand& m) {
       assign(m.duty, {0.9, -0.9, 0.9, 0.9});
     }},
    {"old_command", [](SafetyInputs& in, MotorCommand&) { in.command_age_s = 100.0; }},
};

class SafetyHarmless : public ::testing::TestWithParam<Harmless> {};

TEST_P(SafetyHarmless, KeepsTheMotorsOn) {
  Safety safety(params());
  ASSERT_TRUE(safety.gate(half(), well()).enable);
  SafetyInputs in = well();
  MotorCommand command = half();
  GetParam().cause(in, command);
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(safety.gate(command, in).enable) << i << " " << safety.reasons();
}

INSTANTIATE_TEST_SUITE_P(Every, SafetyHarmless, ::testing::ValuesIn(kHarmless),
                         [](const auto& test) { return test.param.name; });

TEST(Safety, PassesTheDutiesOn) {
  Safety safety(params());
  const MotorCommand command = safety.gate(half(), well());
  EXPECT_TRUE(command.enable);
  EXPECT_EQ(command.duty[1], 0.5);
  SafetyInputs in = well();
  in.arm_requested = false;
  const MotorCommand off = safety.gate(half(), in);
  EXPECT_FALSE(off.enable);
  EXPECT_EQ(off.duty[1], 0.0);
}

TEST(Safety, ABatteryAtTheCutoffMayRecover) {
  Safety safety(params());
  SafetyInputs in = well();
  ASSERT_TRUE(safety.gate(half(), in).enable);
  in.battery_V = 5.5;
  for (int i = 0; i < 99; ++i) ASSERT_TRUE(safety.gate(half(), in).enable) << i;
  EXPECT_TRUE(safety.gate(half(), well()).enable);
}

TEST(Safety, ABatteryThatIsNotReadIsNotEmpty) {
  Safety safety(params());
  SafetyInputs in = well();
  ASSERT_TRUE(safety.gate(half(), in).enable);
  in.battery_ok = false;
  in.battery_V = 0.0;
  for (int i = 0; i < 399; ++i) ASSERT_TRUE(safety.gate(half(), in).enable) << i;
}

TEST(Safety, AnAccelerometerThatIsNotReadDoesNotFall) {
  Safety safety(params());
  SafetyInputs in = well();
  in.bridges_gaps = true;
  ASSERT_TRUE(safety.gate(half(), in).enable);
  in.imu_ok = false;
  in.accel_m_s2 = 0.0;
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(safety.gate(half(), in).enable) << i;
}

TEST(Safety, AttitudeConcernsOnlyWhoNeedsIt) {
  Safety safety{SafetyParams{}};
  SafetyInputs in = well();
  in.attitude_ok = false;
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(safety.gate(half(), in).enable);
}

/// What only a driven robot can show is nothing against one that is off, and is not counted for later.
TEST(Safety, WhatOnlyADrivenRobotShowsIsNothingAgainstArming) {
  Safety safety(params());
  SafetyInputs in = well();
  in.arm_requested = false;
  in.bias_drift_rad_s = 1.0;
  in.motor_error = 10.0;
  in.encoders_stuck = in.encoders_reversed = 1;
  in.state.theta_rad.x() = 0.20;
  in.state.omega_B_rad_s.z() = 2.0;
  MotorCommand command = half();
  command.duty[0] = 0.95;
  for (int i = 0; i < 200; ++i) {
    EXPECT_FALSE(safety.gate(command, in).enable);
    ASSERT_EQ(safety.reasons(), kNotRequested);
  }
  in = well();
  in.command_age_s = 0.5;
  // Armed by the first tick, which was judged as a disarmed one.
  for (int i = 0; i < 61; ++i) ASSERT_TRUE(safety.gate(command, in).enable) << i << " " << safety.reasons();
  EXPECT_FALSE(safety.gate(command, in).enable);
  EXPECT_EQ(safety.reasons(), kStall);
}

TEST(Safety, OneOutlierOfTheInnovationIsBounded) {
  SafetyParams patient = params();
  patient.max_innovation_s = 0.19;  // 38 ticks; the mean of a bounded one is above the limit for 36
  Safety safety(patient);
  SafetyInputs in = well();
  ASSERT_TRUE(safety.gate(half(), in).enable);
  in.state.normalized_innovation = 1e9;
  ASSERT_TRUE(safety.gate(half(), in).enable);
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(safety.gate(half(), well()).enable) << i;
}

}  // namespace
}  // namespace equipoise
