#include "equipoise/actuate/safety.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>

#include "support/assign.hpp"

namespace equipoise {
namespace {

SafetyInputs well() {
  SafetyInputs in;
  in.imu_ok = in.encoders_ok = in.battery_ok = in.attitude_ok = in.all_finite = in.arm_requested = true;
  in.battery_V = 8.0;
  in.accel_m_s2 = kGravity_m_s2;
  return in;
}

MotorCommand half() {
  MotorCommand command{};
  assign(command.duty, {0.5, 0.5, 0.5, 0.0});
  return command;
}

struct Fault {
  const char* name;
  std::uint32_t reason;
  int within_ticks;  // from safety.hpp: the limits and how long they may last
  std::function<void(SafetyInputs&, MotorCommand&)> cause;
};

const Fault kFaults[] = {
    {"tilt", kTilt, 1, [](SafetyInputs& in, MotorCommand&) { in.state.theta_rad.x() = 0.61; }},
    {"tilt_not_a_number", kTilt, 1, [](SafetyInputs& in, MotorCommand&) { in.state.theta_rad.y() = NAN; }},
    {"imu", kImuStale, 3, [](SafetyInputs& in, MotorCommand&) { in.imu_ok = false; }},
    {"imu_gap", kImuStale, 1, [](SafetyInputs& in, MotorCommand&) { in.imu_gap = true; }},
    {"encoders", kEncoderStale, 3, [](SafetyInputs& in, MotorCommand&) { in.encoders_ok = false; }},
    {"encoder_jump", kEncoderJump, 1, [](SafetyInputs& in, MotorCommand&) { in.encoder_jump = true; }},
    {"not_finite", kNotFinite, 1, [](SafetyInputs& in, MotorCommand&) { in.all_finite = false; }},
    {"duty_too_large", kNotFinite, 1, [](SafetyInputs&, MotorCommand& m) { m.duty[1] = 1.5; }},
    {"duty_not_a_number", kNotFinite, 1, [](SafetyInputs&, MotorCommand& m) { m.duty[2] = NAN; }},
    {"attitude", kAttitudeStale, 11, [](SafetyInputs& in, MotorCommand&) { in.attitude_ok = false; }},
    {"battery_low", kBatteryLow, 100, [](SafetyInputs& in, MotorCommand&) { in.battery_V = 5.9; }},
    {"battery_cutoff", kBatteryLow, 5, [](SafetyInputs& in, MotorCommand&) { in.battery_V = 5.4; }},
    {"battery_unknown", kBatteryLow, 400, [](SafetyInputs& in, MotorCommand&) { in.battery_ok = false; }},
    {"estimator", kEstimatorUnhealthy, 15,
     [](SafetyInputs& in, MotorCommand&) { in.state.normalized_innovation = 500.0; }},
    {"slip", kWheelSlip, 10, [](SafetyInputs& in, MotorCommand&) { in.slip_rad_s = -20.0; }},
    {"picked_up", kPickedUp, 10, [](SafetyInputs& in, MotorCommand&) { in.wheel_rate_rad_s[2] = -95.0; }},
    {"dropped", kPickedUp, 10, [](SafetyInputs& in, MotorCommand&) { in.accel_m_s2 = 0.5; }},
    {"saturated", kSaturated, 101, [](SafetyInputs& in, MotorCommand&) { in.saturated = true; }},
    {"bridge", kBridgeFault, 3, [](SafetyInputs& in, MotorCommand&) { in.bridge_fault = true; }},
    {"stall", kStall, 61, [](SafetyInputs&, MotorCommand& m) { m.duty[0] = -0.95; }},
    {"guard", kGuardDead, 1, [](SafetyInputs& in, MotorCommand&) { in.inhibit = kGuardDead; }},
    {"overrun", kOverrun, 1, [](SafetyInputs& in, MotorCommand&) { in.inhibit = kOverrun; }},
};

SafetyParams params() {
  SafetyParams p;
  p.needs_attitude = true;
  return p;
}

class SafetyFault : public ::testing::TestWithParam<Fault> {};

TEST_P(SafetyFault, DisarmsInTimeSaysWhyAndKeepsTheReasonUntilTheRequestIsWithdrawn) {
  Safety safety(params());
  ASSERT_TRUE(safety.gate(half(), well()).enable);
  SafetyInputs in = well();
  MotorCommand command = half();
  GetParam().cause(in, command);
  int ticks = 1;
  while (safety.gate(command, in).enable && ticks < 1000) ++ticks;
  EXPECT_LE(ticks, GetParam().within_ticks);
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
  EXPECT_EQ(refused([](SafetyInputs& in) { in.imu_ok = false; }), kImuStale);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.command_age_s = 0.6; }), kCommandStale);
  EXPECT_EQ(refused([](SafetyInputs& in) { in.command_age_s = NAN; }), kCommandStale);
  for (const std::uint32_t reason : {kNotCalibrated, kEncoderSign, kRealtimeMissing, kGuardDead, kOverrun,
                                     kBridgeFault, kWriteFailed, kLogFailed}) {
    EXPECT_EQ(refused([reason](SafetyInputs& in) { in.inhibit = reason; }), reason);
  }
}

TEST(Safety, OneMissedSampleIsRiddenThrough) {
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
  EXPECT_EQ(safety.timely(command).yaw_rate_rad_s, 3.0);
  command.age_s = 0.6;
  const Command obeyed = safety.timely(command);
  EXPECT_TRUE(obeyed.arm);
  EXPECT_TRUE(obeyed.velocity_W_m_s.isZero(0.0));
  EXPECT_EQ(obeyed.yaw_rate_rad_s, 0.0);
}

TEST(SafetyReasons, EveryBitHasANameOfItsOwn) {
  std::set<std::string> names;
  for_each_reason(~0U, [&](const char* name) { names.insert(name); });
  EXPECT_EQ(names.size(), kSafetyReasonNames.size());
  EXPECT_EQ(kWheelFour, 1U << (kSafetyReasonNames.size() - 1));
  EXPECT_EQ(kSafetyReasonNames[13], std::string("guard_dead"));
  EXPECT_EQ(kSafetyReasonNames[18], std::string("wheel_slip"));
}

}  // namespace
}  // namespace equipoise
