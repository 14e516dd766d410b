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
#include "app/trial/path.hpp"
#include "app/trial/script.hpp"
#include "app/trial/verdict.hpp"
#include "equipoise/samples.hpp"

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

class RunMeter {
 public:
  RunMeter(std::size_t estimators, double rolling_radius_m)
      : compared_(estimators), rolling_radius_m_(rolling_radius_m) {}

  static bool settled(double time_s) noexcept { return time_s >= kSettled_s; }
  void motors(const MotorCommand& motors, bool saturated);
  void controlling(const StateErrors& e) { controlling_.add(e); }
  void compared(std::size_t i, const StateErrors& e) { compared_[i].add(e); }
  void path(double time_s, const StateView& reference, const StateView& truth);
  /// `forward_W_m`: where the robot truly is, its first heading along x.
  void following(const PathPoint& path, const Vec2& forward_W_m);
  /// The controlling estimate in its own yaw frame.
  void rolling(const StateView& estimate, const StateView& truth, int axes);
  void innovation(const StateView& estimate);
  void heading(const StateView& estimate, const StateView& truth);

  SimSummary summary(const Verdict& verdict, std::int64_t ticks, double wall_s) const;
  EstimatorErrors compared_errors(std::size_t i) const { return compared_[i].value(); }

 private:
  class Rms {
   public:
    void add(double squared, int axes) {
      sum_ += squared;
      count_ += axes;
    }
    double value() const;
    bool empty() const { return count_ == 0; }

   private:
    double sum_ = 0.0;
    std::int64_t count_ = 0;
  };
  class Errors {
   public:
    void add(const StateErrors& e) {
      attitude_.add(e.attitude_squared, e.axes);
      speed_.add(e.speed_squared, e.axes);
    }
    EstimatorErrors value() const { return {attitude_.value(), speed_.value()}; }

   private:
    Rms attitude_, speed_;
  };

  Errors controlling_;
  std::vector<Errors> compared_;
  double rolling_radius_m_;
  Rms position_;
  Rms following_;
  Vec2 path_start_W_m_ = Vec2::Zero();
  Rms rolling_;
  double innovation_sum_ = 0.0;
  std::int64_t innovations_ = 0;
  double heading_error_ = kUncounted;
  double yaw_from_ = 0.0;
  double yaw_from_s_ = -1.0;
  double yaw_to_ = 0.0;
  double yaw_to_s_ = 0.0;
  double duty_max_ = 0.0;
  std::int64_t saturated_ = 0;
  std::int64_t driven_ = 0;
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
