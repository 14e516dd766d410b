// One simulated run of a robot through the production pipeline and the hardware boundary.
// In: configuration, choices, options -> out: summary; every tick is handed to `observe`. Same seed, same
// numbers.
#pragma once

#include <atomic>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "app/io/practice_backend.hpp"
#include "app/trial/firmware.hpp"
#include "app/trial/script.hpp"
#include "app/trial/verdict.hpp"

namespace equipoise::app {

/// Errors count from here on.
inline constexpr double kSettled_s = 5.0;

inline constexpr double kUncounted = std::numeric_limits<double>::quiet_NaN();

struct EstimatorErrors {
  double attitude_rmse_rad = kUncounted;
  double speed_rmse = kUncounted;  // m/s of the ball, or rad/s of the wheels
};

struct SimSummary {
  Verdict verdict;
  EstimatorErrors controlling;
  double yaw_frame_speed_rmse_m_s = kUncounted;    // of rolling, without what a wrong heading adds
  double heading_error_rad = kUncounted;           // estimate minus truth, at the end
  double position_rmse_m = kUncounted;             // against the reference
  double path_rmse_m = kUncounted;                 // against the path, from its start
  double normalized_innovation_mean = kUncounted;  // 1 for a consistent filter
  double yaw_rate_mean_hz = kUncounted;
  double duty_max = 0.0;
  double saturated_fraction = 0.0;
  std::uint32_t degraded = 0;  // DegradedBit: what it did without at any time
  std::int64_t ticks = 0;
  double real_time_factor = 0.0;
  std::map<std::string, EstimatorErrors> estimators;
};

struct SimOptions {
  Script script;
  double duration_s = 30.0;
  std::uint64_t seed = 1;
  bool figures = true;  // false: only the verdict
  std::vector<PlannedFault> faults{};
  const std::atomic<bool>* log_failed = nullptr;  // then the motors stop: nothing runs unrecorded
};

using TickObserver = std::function<void(const runtime::TickRecord&)>;

/// `choice.fidelity` names the world, `choice.controller` the pipeline.
SimSummary simulate(const ConfiguredRobot& robot, const Choice& choice, const SimOptions& options,
                    const TickObserver& observe, const std::atomic<bool>& stop);

}  // namespace equipoise::app
