// Why the motors are off and what the robot does without, in words and numbers: one row each, which the
// terminal, the log's pages, the cockpit (tools/equipoise_tools/names.py) and docs/reasons.md read.
// In: bits of SafetyReason or DegradedBit, the tick that gave them -> out: names, sentences.
#pragma once

#include <string>
#include <vector>

#include "equipoise/actuate/degraded.hpp"
#include "equipoise/actuate/safety.hpp"
#include "equipoise/runtime/record.hpp"

namespace equipoise::app {

/// What a reason is a number of, in the tick that gave it.
struct ReasonNumbers {
  bool was_armed = false;  // before the motors went off
  double tilt_rad = 0.0;
  Vec2 tilt_xy_rad = Vec2::Zero(), tilt_rate_rad_s = Vec2::Zero();
  double rate_rad_s = 0.0;
  double battery_V = 0.0;
  double innovation = 0.0;
  double command_age_s = 0.0;
};
ReasonNumbers reason_numbers(const runtime::TickRecord& tick) noexcept;

/// A number against its limit; where it is not beyond the limit, it is not why.
struct ReasonLimit {
  enum class When { kAlways, kArming, kArmed };
  When when;
  const char* what;
  const char* unit;
  double (*value)(const ReasonNumbers&, const SafetyParams&);
  double SafetyParams::*limit;
  bool below = false;
};

struct Reason {
  std::uint32_t bit;
  const char* name;
  const char* text;
  const char* remedy;
  std::vector<ReasonLimit> limits{};
};
const std::vector<Reason>& safety_reasons();  // in the order of the bits
const std::vector<Reason>& degraded_modes();

std::vector<std::string> reason_names(std::uint32_t reasons);
std::vector<std::string> degraded_names(std::uint32_t degraded);

/// "tilt, imu_stale"
std::string reasons_text(std::uint32_t reasons);

/// A line each: "tilt 0.31 rad, limit 0.20 rad: hold it upright before arming". A reason without a number
/// says what it means.
std::vector<std::string> reasons_explained(std::uint32_t reasons, const ReasonNumbers& numbers,
                                           const SafetyParams& limits);

}  // namespace equipoise::app
