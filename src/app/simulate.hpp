// One simulated run of the MBBR through the production pipeline and the hardware boundary.
// In: configuration, options -> out: summary; every tick is handed to `observe`. Same seed, same numbers.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <string>

#include "equipoise/config.hpp"
#include "equipoise/runtime/record.hpp"

namespace equipoise::app {

enum class MbbrController { kThesis, kScheduled };
inline const std::vector<std::string> kMbbrControllerNames{"thesis", "scheduled"};

struct SimOptions {
  MbbrController controller = MbbrController::kScheduled;
  double yaw_hz = 0.0;
  double drive_mps = 0.0;
  double duration_s = 30.0;
  std::uint64_t seed = 1;
  Fidelity fidelity = Fidelity::kFull;
  bool compare = false;
};

struct EstimatorErrors {
  double attitude_rmse_rad = 0.0;
  double ball_speed_rmse_m_s = 0.0;
};

struct SimSummary {
  bool fell = false;
  double fell_at_s = -1.0;
  EstimatorErrors controlling;
  double position_rmse_m = 0.0;
  double yaw_rate_mean_hz = 0.0;
  double duty_max = 0.0;
  double saturated_fraction = 0.0;
  std::int64_t ticks = 0;
  double real_time_factor = 0.0;
  std::uint32_t reasons = 0;  // why the motors went off, if they did
  bool interrupted = false;
  std::map<std::string, EstimatorErrors> estimators;
};

/// When the drive starts, s; before it the robot balances in place. Motors are requested at kArmAt.
inline constexpr double kArmAt_s = 0.5;
inline constexpr double kDriveFrom_s = 1.0;
/// Errors count from here on.
inline constexpr double kSettled_s = 5.0;

using TickObserver = std::function<void(const runtime::TickRecord&)>;

SimSummary simulate_mbbr(const MbbrConfig& config, const SimOptions& options, const TickObserver& observe,
                         const std::atomic<bool>& stop);

}  // namespace equipoise::app
