// Why the motors are off: one bit per reason, for telemetry, CLI, LED and CAN. Their names, meanings and
// remedies: src/app/text/reasons.cpp.
#pragma once

#include <cstdint>

namespace equipoise {

enum SafetyReason : std::uint32_t {
  kNotRequested = 1u << 0,
  kTilt = 1u << 1,
  kImuStale = 1u << 2,
  kEncoderStale = 1u << 3,
  kNotFinite = 1u << 4,
  kBatteryLow = 1u << 5,
  kAttitudeStale = 1u << 6,
  kGyroMoving = 1u << 7,  // arming only
  kNotCalibrated = 1u << 8,
  kEncoderSign = 1u << 9,
  kEstimatorUnhealthy = 1u << 10,
  kCommandStale = 1u << 11,  // arming only; while armed the robot ramps to a stop
  kRealtimeMissing = 1u << 12,
  kGuardDead = 1u << 13,
  kOverrun = 1u << 14,
  kPickedUp = 1u << 15,
  kStall = 1u << 16,
  kSaturated = 1u << 17,
  kWheelSlip = 1u << 18,
  kEncoderJump = 1u << 19,
  kBridgeFault = 1u << 20,
  kWriteFailed = 1u << 21,
  kLogFailed = 1u << 22,
  kEncoderStuck = 1u << 23,
  kWheelOne = 1u << 24,  // which, with kEncoderStuck and kEncoderSign
  kWheelTwo = 1u << 25,
  kWheelThree = 1u << 26,
  kWheelFour = 1u << 27,
  kImuUntrusted = 1u << 28,  // an axis lies, or stands still
  kMotorFault = 1u << 29,    // motors do not do as told
};

}  // namespace equipoise
