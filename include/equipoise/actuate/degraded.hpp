// What a robot does without while it runs on: one bit and one speed limit per mode. Their names, meanings
// and remedies: src/app/text/reasons.cpp. In: bits, a command -> out: the command within the limits. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "equipoise/samples.hpp"

namespace equipoise {

enum DegradedBit : std::uint32_t {
  kWithoutImu = 1u << 0,       // the model bridges a gap
  kWithoutEncoders = 1u << 1,  // likewise
  kEstimatorInDoubt = 1u << 2,
  kWithoutWheelOne = 1u << 3,  // its encoder lies and is not used
  kWithoutWheelTwo = 1u << 4,
  kWithoutWheelThree = 1u << 5,
  kWithoutWheelFour = 1u << 6,
  kWithoutGyroAxis = 1u << 7,  // it is dead or lies
  kGyroBiasJumped = 1u << 8,   // by how much is known
};

/// Not for a gap, but because they lie.
inline constexpr std::uint32_t kSensorsLeftOut =
    kWithoutWheelOne | kWithoutWheelTwo | kWithoutWheelThree | kWithoutWheelFour | kWithoutGyroAxis;

/// What a fault detector has decided, not what is missing for a while.
inline constexpr std::uint32_t kSensorsJudged = kSensorsLeftOut | kGyroBiasJumped;

struct DegradedMode {
  double max_speed_m_s;
  double max_yaw_rate_rad_s;
};

inline constexpr double kUnlimited = 1e9;

/// In the order of the bits. A gap is over before a slower setpoint would help, and braking into it topples
/// (8 of 50 at 1 Hz, 100 ms); who doubts his estimate stands; one encoder less leaves no second opinion on
/// slip, so the robot goes no faster than it was tried; so does one whose gyro may jump again.
inline constexpr std::array<DegradedMode, 9> kDegradedModes{{
    {kUnlimited, kUnlimited},
    {kUnlimited, kUnlimited},
    {0.0, 0.0},
    {0.1, 2.0 * kPi},
    {0.1, 2.0 * kPi},
    {0.1, 2.0 * kPi},
    {0.1, 2.0 * kPi},
    {0.0, 0.0},
    {0.1, 2.0 * kPi},
}};

inline Command limited(const Command& command, std::uint32_t degraded) noexcept {
  Command slow = command;
  for (std::size_t i = 0; i < kDegradedModes.size() && degraded >> i != 0; ++i) {
    if ((degraded >> i & 1u) == 0) continue;
    const DegradedMode& mode = kDegradedModes[i];
    const double speed = slow.velocity_W_m_s.norm();
    if (speed > mode.max_speed_m_s) slow.velocity_W_m_s *= mode.max_speed_m_s / speed;
    slow.yaw_rate_rad_s = std::clamp(slow.yaw_rate_rad_s, -mode.max_yaw_rate_rad_s, mode.max_yaw_rate_rad_s);
  }
  return slow;
}

}  // namespace equipoise
