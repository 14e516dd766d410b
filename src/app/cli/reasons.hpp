// Why the motors are off, in words. In: bits of SafetyReason -> out: their names.
#pragma once

#include <string>
#include <vector>

#include "equipoise/actuate/safety_reasons.hpp"

namespace equipoise::app {

inline std::vector<std::string> reason_names(std::uint32_t reasons) {
  std::vector<std::string> names;
  for_each_reason(reasons, [&names](const char* name) { names.emplace_back(name); });
  return names;
}

/// "tilt, imu_stale"
inline std::string reasons_text(std::uint32_t reasons) {
  std::string text;
  for (const std::string& name : reason_names(reasons)) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace equipoise::app
