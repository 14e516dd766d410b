// Why the motors are off and what the robot does without, in words. In: bits of SafetyReason or DegradedBit
// -> out: their names.
#pragma once

#include <string>
#include <vector>

#include "equipoise/actuate/degraded.hpp"
#include "equipoise/actuate/safety_reasons.hpp"

namespace equipoise::app {

inline std::vector<std::string> reason_names(std::uint32_t reasons) {
  std::vector<std::string> names;
  for_each_reason(reasons, [&names](const char* name) { names.emplace_back(name); });
  return names;
}

inline std::vector<std::string> degraded_names(std::uint32_t degraded) {
  std::vector<std::string> names;
  for_each_degraded(degraded, [&names](const DegradedMode& mode) { names.emplace_back(mode.name); });
  return names;
}

/// "tilt, imu_stale"
inline std::string reasons_text(std::uint32_t reasons) {
  std::string text;
  for (const std::string& name : reason_names(reasons)) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace equipoise::app
