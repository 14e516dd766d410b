// Why the motors are off, in words: bits of SafetyReason -> machine-readable names. docs/safety.md
#pragma once

#include <array>
#include <string>
#include <vector>

#include "equipoise/actuate/safety.hpp"

namespace equipoise::app {

inline std::vector<std::string> reason_names(std::uint32_t reasons) {
  static constexpr std::array<const char*, 8> kNames{"not_requested",  "tilt",       "imu_stale",
                                                     "encoder_stale",  "not_finite", "battery_low",
                                                     "attitude_stale", "gyro_moving"};
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if ((reasons & (1U << i)) != 0) names.emplace_back(kNames[i]);
  }
  return names;
}

}  // namespace equipoise::app
