#include "equipoise/actuate/safety.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>

#include "support/assign.hpp"
#include "support/safety_inputs.hpp"

namespace equipoise {
namespace {

struct Fault {
  const char* name;
  std::uint32_t reason;
  int in_ticks;  // neither later nor sooner; from safety.hpp: the limits and how long they may last
  std::function<void(SafetyInputs&, MotorCommand&)> cause;
};

const Fault kFaults[] = {
    {"tilt", kTilt, 1, [](SafetyInputs& in, MotorCommand&) { in.state.theta_rad.x() = 0.61; }},
    {"tilt_on_its_way_back", kTilt, 1,
     [](SafetyInputs& in, MotorCommand&) {
       in.state.theta_rad.x() = 0.61;
       in.state.omega_B_rad_s.x() = -2.0;
     }},
    {"falling", kTilt, 1,
     [](SafetyInputs& in, MotorCommand&) {
       in.state.theta_rad.x() = -0.3;
       in.state.omega_B_rad_s.x() = -2.6;  // 0.12 s of it
     }},
    {"falling_not_a_number", kTilt, 1,
     [](SafetyInputs& in, MotorCommand&) { in.state.omega_B_rad_s.y() = NAN; }},
    {"bias", kImuUntrusted, 1, [](SafetyInputs& in, MotorCommand&) { in.bias_drift_rad_s = 0.11; }},
    {"motors", kMotorFault, 1, [](SafetyInputs& in, MotorCommand&) { in.motor_error = 0.8; }},
    {"tilt_not_a_number", kTilt, 1, [](SafetyInputs& in, MotorCommand&) { in.state.theta_rad.y() = NAN; }},
    {"imu", kImuStale, 3, [](SafetyInputs& in, MotorCommand&) { in.imu_ok = false; }},
    {"imu_bridged", kImuStale, 31,
     [](SafetyInputs& in, MotorCommand&) {
       in.bridges_gaps = true;
       in.imu_ok = false;
     }},
    {"encoders_bridged", kEncoderStale, 31,
     [](SafetyInputs& in, MotorCommand&) {
       in.bridges_gaps = true;
       in.encoders_ok = false;
     }},
    {"both_bridged", kImuStale | kEncoderStale, 9,
     [](SafetyInputs& in, MotorCommand&) {
       in.bridges_gaps = true;
       in.imu_ok = in.encoders_ok = false;
     }},
    {"encoders", kEncoderStale, 3, [](SafetyInputs& in, MotorCommand&) { in.encoders_ok = false; }},
    {"encoder_jump", kEncoderJump, 1, [](SafetyInputs& in, MotorCommand&) { in.encoder_jump = true; }},
    {"not_finite", kNotFinite, 1, [](SafetyInputs& in, MotorCommand&) { in.all_finite = false; }},
    {"duty_too_large", kNotFinite, 1, [](SafetyInputs&, MotorCommand& m) { m.duty[1] = 1.5; }},
    {"duty_not_a_number", kNotFinite, 1, [](SafetyInputs&, MotorCommand& m) { m.duty[2] = NAN; }},
    {"attitude", kAttitudeStale, 11, [](SafetyInputs& in, MotorCommand&) { in.attitude_ok = false; }},
    {"battery_low", kBatteryLow, 100, [](SafetyInputs& in, MotorCommand&) { in.battery_V = 5.9; }},
    {"battery_cutoff", kBatteryLow, 5, [](SafetyInputs& in, MotorCommand&) { in.battery_V = 5.4; }},
    {"battery_unknown", kBatteryLow, 400, [](SafetyInputs& in, MotorCommand&) { in.battery_ok = false; }},
    {"estimator", kEstimatorUnhealthy, 11,
     [](SafetyInputs& in, MotorCommand&) { in.state.normalized_innovation = 500.0; }},
    {"estimator_slowly", kEstimatorUnhealthy, 28,  // the mean takes 18
     [](SafetyInputs& in, MotorCommand&) { in.state.normalized_innovation = 3.0; }},
    {"tilt_unknown", kEstimatorUnhealthy, 1,
     [](SafetyInputs& in, MotorCommand&) { in.tilt_sigma_rad = 0.11; }},
    {"tilt_sigma_not_a_number", kEstimatorUnhealthy, 1,
     [](SafetyInputs& in, MotorCommand&) { in.tilt_sigma_rad = NAN; }},
    {"imu_untrusted", kImuUntrusted, 1, [](SafetyInputs& in, MotorCommand&) { in.imu_trusted = false; }},
    {"encoder_stuck", kEncoderStuck | (kWheelOne << 1), 1,
     [](SafetyInputs& in, MotorCommand&) { in.encoders_stuck = 2; }},
    {"encoder_reversed", kEncoderSign | (kWheelOne << 2), 1,
     [](SafetyInputs& in, MotorCommand&) { in.encoders_reversed = 4; }},
    {"encoders_stuck_and_reversed", kEncoderStuck | kEncoderSign | kWheelOne | (kWheelOne << 2), 1,
     [](SafetyInputs& in, MotorCommand&) {
       in.encoders_stuck = 1;
       in.encoders_reversed = 4;
     }},
    {"picked_up", kPickedUp, 10, [](SafetyInputs& in, MotorCommand&) { in.wheel_rate_rad_s[2] = -95.0; }},
    {"picked_up_turning", kPickedUp, 10,
     [](SafetyInputs& in, MotorCommand&) {
       in.wheel_rate_rad_s[2] = -75.0;
       in.turn_rad_s[2] = 20.0;
     }},
    {"dropped", kPickedUp, 10, [](SafetyInputs& in, MotorCommand&) { in.accel_m_s2 = 0.5; }},
    {"bridge", kBridgeFault, 3, [](SafetyInputs& in, MotorCommand&) { in.bridge_fault = true; }},
    {"stall_of_the_last", kStall, 61,
     [](SafetyInputs& in, MotorCommand& m) {
       m.duty[2] = 0.91;
       in.wheel_rate_rad_s = {9.0, 9.0, -0.49, 9.0};
     }},
    {"stall_of_the_first_alone", kStall, 61,
     [](SafetyInputs& in, MotorCommand& m) {
       assign(m.duty, {0.95, 0.95, 0.95, 0.95});
       in.wheel_rate_rad_s = {0.0, 9.0, 9.0, 9.0};
     }},
    {"stall", kStall, 61, [](SafetyInputs&, MotorCommand& m) { m.duty[0] = -0.95; }},
    {"guard", kGuardDead, 1, [](SafetyInputs& in, MotorCommand&) { in.inhibit = kGuardDead; }},
    {"overrun", kOverrun, 1, [](SafetyInputs& in, MotorCommand&) { in.inhibit = kOverrun; }},
};

class SafetyFault : public ::testing::TestWithParam<Fault> {};

TEST_P(SafetyFault, DisarmsInTimeSaysWhyAndKeepsTheReasonUntilTheRequestIsWithdrawn) {
  Safety safety(params());
  ASSERT_TRUE(safety.gate(half(), well()).enable);
  SafetyInputs in = well();
  MotorCommand command = half();
  GetParam().cause(in, command);
  int ticks = 1;
  while (safety.gate(command, in).enable && ticks < 1000) ++ticks;
  EXPECT_EQ(ticks, GetParam().in_ticks);
  EXPECT_EQ(safety.state(), ArmState::kFault);
  EXPECT_EQ(safety.reasons(), GetParam().reason);

  // The cause goes away: still off, and still known.
  for (int i = 0; i < 200; ++i) EXPECT_FALSE(safety.gate(half(), well()).enable);
  EXPECT_EQ(safety.reasons(), GetParam().reason);
  SafetyInputs withdrawn = well();
  withdrawn.arm_requested = false;
  EXPECT_FALSE(safety.gate(half(), withdrawn).enable);
  EXPECT_EQ(safety.state(), ArmState::kDisarmed);
  EXPECT_EQ(safety.reasons(), kNotRequested);
  EXPECT_TRUE(safety.gate(half(), well()).enable);
}

TEST_P(SafetyFault, WithoutItTheMotorsStayOn) {
  Safety safety(params());
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(safety.gate(half(), well()).enable);
}

INSTANTIATE_TEST_SUITE_P(Every, SafetyFault, ::testing::ValuesIn(kFaults),
                         [](const auto& test) { return test.param.name; });

/// Counted from a robot's first tick on, before it was ever armed.
TEST(Safety, WhatIsWrongFromTheStartIsNotCountedLonger) {
  for (const char* name : {"attitude", "battery_low", "battery_cutoff", "battery_unknown", "estimator",
                           "picked_up", "dropped", "bridge"}) {
    const auto* fault = std::find_if(std::begin(kFaults), std::end(kFaults),
                                     [name](const Fault& f) { return f.name == std::string(name); });
    Safety safety(params());
    SafetyInputs in = well();
    in.arm_requested = false;
    MotorCommand command = half();
    fault->cause(in, command);
    int ticks = 1;
    while ((void)safety.gate(command, in), (safety.reasons() & fault->reason) == 0 && ticks < 1000) ++ticks;
    EXPECT_EQ(ticks, fault->in_ticks) << name;
  }
}

SafetyInputs late(int ticks) {
  SafetyInputs in = well();
  in.bridges_gaps = true;
  in.inhibit = kOverrun;
  in.ticks = ticks;
  return in;
}

TEST(Safety, LetsGoForATickAfterAShortStallAndStaysArmed) {
  Safety safety(params());
  ASSERT_TRUE(safety.gate(half(), well()).enable);
  EXPECT_FALSE(safety.gate(half(), late(13)).enable);  // a guard that has cut sees that the loop lets go
  EXPECT_TRUE(safety.armed());
  for (int i = 0; i < 201; ++i) ASSERT_TRUE(safety.gate(half(), well()).enable);
  EXPECT_FALSE(safety.gate(half(), late(4)).enable);  // a second later it may happen again
  EXPECT_TRUE(safety.armed());
}

TEST(Safety, DisarmsAfterALongStallOrTheSecondWithinASecond) {
  Safety once(params());
  ASSERT_TRUE(once.gate(half(), well()).enable);
  (void)once.gate(half(), late(14));
  EXPECT_EQ(once.state(), ArmState::kFault);
  EXPECT_EQ(once.reasons(), kOverrun);

  Safety soon(params());
  ASSERT_TRUE(soon.gate(half(), well()).enable);
  (void)soon.gate(half(), late(5));
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(soon.gate(half(), well()).enable);
  (void)soon.gate(half(), late(5));
  EXPECT_EQ(soon.state(), ArmState::kFault);

  Safety blind(params());
  ASSERT_TRUE(blind.gate(half(), well()).enable);
  SafetyInputs unbridged = late(2);
  unbridged.bridges_gaps = false;
  (void)blind.gate(half(), unbridged);
  EXPECT_EQ(blind.state(), ArmState::kFault);

  Safety twice(params());
  ASSERT_TRUE(twice.gate(half(), well()).enable);
  (void)twice.gate(half(), late(5));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(twice.gate(half(), well()).enable);
  (void)twice.gate(half(), late(5));
  EXPECT_EQ(twice.state(), ArmState::kFault);
}

TEST(Safety, DoesNotArmInALateTick) {
  Safety safety(params());
  EXPECT_FALSE(safety.gate(half(), late(4)).enable);
  EXPECT_EQ(safety.state(), ArmState::kDisarmed);
}

TEST(Safety, RefusesToArmAndSaysWhy) {
  const auto refused = [](auto&& change) {
    Safety safety(params());
    SafetyInputs in = well();
    change(in);
    EXPECT_FALSE(safety.gate(half(), in).enable);
    EXPECT_EQ(safety.state(), ArmState::kDisarmed);
    return safety.reasons();
  };
  EXPECT_EQ(refused([](SafetyInputs& in) { in.arm_requested = false; }), kNotRequested);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.state.theta_rad.x() = 0.21; }), kTilt);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.state.omega_B_rad_s.z() = 2.1; }), kGyroMoving);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.gyro_bias_known = false; }), kGyroMoving);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.imu_ok = false; }), kImuStale);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.encoders_ok = false; }), kEncoderStale);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.command_age_s = 0.6; }), kCommandStale);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.command_age_s = NAN; }), kCommandStale);
  for (const std::uint32_t reason : {kNotCalibrated, kEncoderSign, kRealtimeMissing, kGuardDead, kOverrun,
                                     kBridgeFault, kWriteFailed, kLogFailed}) {
    EXPECT_EQ(refused([reason](SafetyInputs& in) { in.inhibit = reason; }), reason);
  }
}

TEST(Safety, ItsLimitsThemselvesAreAllowed) {
  const SafetyParams p = params();
  SafetyInputs in = well();
  in.state.theta_rad.x() = p.max_arm_tilt_rad;
  in.state.omega_B_rad_s.z() = p.max_arm_rate_rad_s;
  in.command_age_s = p.command_timeout_s;
  in.tilt_sigma_rad = p.max_tilt_sigma_rad;
  in.bias_drift_rad_s = p.max_bias_drift_rad_s;
  in.motor_error = p.max_motor_error;
  in.battery_V = p.min_battery_V;
  in.wheel_rate_rad_s[1] = p.max_wheel_rate_rad_s;
  in.wheel_rate_rad_s[2] = p.max_wheel_rate_rad_s + 50.0;
  in.turn_rad_s[2] = 50.0;  // as it turns on the spot
  Safety safety(p);
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(safety.gate(half(), in).enable) << safety.reasons();
}

TEST(Safety, OneMissedSampleIsTolerated) {
  Safety safety(params());
  SafetyInputs missed = well();
  missed.imu_ok = missed.encoders_ok = false;
  ASSERT_TRUE(safety.gate(half(), well()).enable);
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(safety.gate(half(), missed).enable);
    ASSERT_TRUE(safety.gate(half(), missed).enable);
    ASSERT_TRUE(safety.gate(half(), well()).enable);
  }
}

TEST(Safety, EstimatorHealthHasHysteresis) {
  Safety safety(params());
  SafetyInputs in = well();
  in.arm_requested = false;
  in.state.normalized_innovation = 3.5;
  for (int i = 0; i < 100; ++i) safety.gate(half(), in);
  in.arm_requested = true;
  in.state.normalized_innovation = 1.5;  // below the limit, above half of it
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(safety.gate(half(), in).enable);
  in.state.normalized_innovation = 1.0;
  for (int i = 0; i < 100; ++i) safety.gate(half(), in);
  EXPECT_TRUE(safety.armed());
}

TEST(Safety, APushIsNoReasonToDistrustAPatientEstimator) {
  SafetyParams patient = params();
  patient.max_innovation_s = 0.5;
  Safety safety(patient);
  SafetyInputs surprised = well();
  surprised.state.normalized_innovation = 500.0;
  ASSERT_TRUE(safety.gate(half(), well()).enable);
  for (int i = 0; i < 10; ++i) safety.gate(half(), surprised);
  for (int i = 0; i < 200; ++i) EXPECT_TRUE(safety.gate(half(), well()).enable) << i;
}

TEST(Safety, AFallThatIsBeingCaughtIsNone) {
  Safety safety(params());
  SafetyInputs in = well();
  ASSERT_TRUE(safety.gate(half(), in).enable);
  in.state.theta_rad.x() = -0.5;
  in.state.omega_B_rad_s.x() = 5.0;
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(safety.gate(half(), in).enable);
}

/// Ticks that a surprise lasts until the motors are off.
int ticks_of_surprise(std::uint32_t left_out, double before) {
  SafetyParams patient = params();
  patient.max_innovation_s = 0.5;
  Safety safety(patient);
  SafetyInputs in = well();
  in.state.normalized_innovation = before;
  for (int i = 0; i < 30; ++i) (void)safety.gate(half(), in);
  in.left_out = left_out;
  in.state.normalized_innovation = 500.0;
  int ticks = 1;
  while (safety.gate(half(), in).enable && ticks < 1000) ++ticks;
  EXPECT_EQ(safety.reasons(), kEstimatorUnhealthy);
  return ticks;
}

TEST(Safety, WithASensorLessASurpriseIsAnotherFault) {
  EXPECT_EQ(ticks_of_surprise(0, 0.5), 101);
  EXPECT_EQ(ticks_of_surprise(1, 0.5), 7);
}

TEST(Safety, WhatWasBeforeTheSensorWasLeftOutIsForgotten) {
  SafetyParams patient = params();
  patient.max_innovation_s = 0.5;
  Safety safety(patient);
  SafetyInputs in = well();
  in.state.normalized_innovation = 500.0;
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(safety.gate(half(), in).enable);
  in.left_out = 1;
  in.state.normalized_innovation = 0.5;
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(safety.gate(half(), in).enable) << i;
}

TEST(Safety, TheEncoderCheckGoesBeforeTheEstimator) {
  Safety safety(params());
  SafetyInputs in = well();
  in.encoders_in_check = true;
  in.state.normalized_innovation = 500.0;
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(safety.gate(half(), in).enable);
  in.encoders_in_check = false;
  for (int i = 0; i < 15; ++i) safety.gate(half(), in);
  EXPECT_TRUE(safety.reasons() & kEstimatorUnhealthy);
}

TEST(Safety, AnOldCommandAsksForAStop) {
  const Safety safety(params());
  Command command;
  command.arm = true;
  command.velocity_W_m_s = Vec2(0.1, 0.2);
  command.yaw_rate_rad_s = 3.0;
  command.age_s = 0.5;
  EXPECT_EQ(safety.timely(command).yaw_rate_rad_s, 3.0);
  EXPECT_EQ(safety.timely(command).velocity_W_m_s, Vec2(0.1, 0.2));
  command.age_s = 0.6;
  const Command obeyed = safety.timely(command);
  EXPECT_TRUE(obeyed.arm);
  EXPECT_TRUE(obeyed.velocity_W_m_s.isZero(0.0));
  EXPECT_EQ(obeyed.yaw_rate_rad_s, 0.0);
}

}  // namespace
}  // namespace equipoise
