// What a robot's estimators do alike: run the one that is asked for, or all, and a default filter beside the
// detector that finds its sensors' faults. In: Measurement, input, as the robot's estimators -> out:
// estimates, health. `Filter`: of the robot; its kBiases gyro biases are watched for a drift. RT-safe.
#pragma once

#include <array>

#include "equipoise/estimate/health.hpp"
#include "equipoise/estimate/motor_error.hpp"
#include "equipoise/estimate/rest_bias.hpp"
#include "equipoise/estimate/rest_tilt.hpp"
#include "equipoise/estimate/sensor_faults.hpp"
#include "equipoise/estimate/slow_drift.hpp"

namespace equipoise {

template <class Robot, class Filter, class Params_, const auto& kEstimatorNames>
class FaultTolerant {
 public:
  using Params = Params_;
  using Id = decltype(Params::active);
  using Estimate = typename Robot::Estimate;
  using Sample = typename Robot::Sample;
  using Health = EstimatorHealth<Robot::kWheels>;
  static constexpr const auto& kNames = kEstimatorNames;
  static constexpr std::size_t kCount = kEstimatorNames.size();

  /// Simulation only: what `truth` returns from now on.
  void observe_truth(const Estimate& truth) noexcept { at(Id::kTruth) = truth; }

  bool runs(Id id) const noexcept { return id == params_.active || params_.compare; }
  const Estimate& estimate(Id id) const noexcept { return estimates_[index(id)]; }
  /// The default filter: rows, variances, predicted wheel rates.
  const Filter& ekf() const noexcept { return ekf_; }
  /// It finds a faulty encoder by itself.
  bool isolates() const noexcept { return params_.active == Id::kEkf; }
  /// Default filters that run: the control's, and those that look for faults; see sensor_faults.hpp.
  int filters() const noexcept { return params_.detection ? faults_.ran() : 1; }
  /// Of the active estimator; only the default filter tells.
  Health health() const noexcept {
    Health h;
    if (!isolates()) return h;
    h.tilt_sigma_rad = ekf_.tilt_sigma_rad();
    h.wheel_rate_rad_s = ekf_.wheel_rate_rad_s();
    h.predicts_wheels = true;
    h.gyro_bias_known = rest_bias_.known();
    if (!params_.detection) return h;
    report(faults_, &h);
    if (faults_.suspects()) return h;  // a fault may explain what the filter has made of it: a bias, a torque
    h.bias_drift_rad_s = bias_drift_.distance_rad_s();
    h.motor_error = motor_error_.worst();
    return h;
  }

 protected:
  /// `evidence`: the default filter's parameters as the detector has them; `slips_s`: see motor_error.hpp.
  FaultTolerant(const Params& params, const SensorFaultsParams& faults,
                const typename Filter::Params& evidence, double slips_s)
      : params_(params),
        kinematics_(params.robot),
        ekf_(params.robot, params.ekf),
        faults_(Filter(params.robot, evidence), faults),
        motor_error_(slips_s) {}

  static std::size_t index(Id id) noexcept { return static_cast<std::size_t>(id); }
  Estimate& at(Id id) noexcept { return estimates_[index(id)]; }

  /// At rest, tilted so.
  void start_filter(const Vec2& tilt_rad, const Sample& z) noexcept {
    ekf_.start(Filter::lean(tilt_rad), rest_bias_.update(z.gyro_B_rad_s), z.wheel_angle_rad);
    start_detection();
  }
  /// After start_filter(), of a robot that moves as the sample says.
  void start_filter_moving(const Vec2& tilt_rad, const Vec3& gyro_bias_B_rad_s, const Sample& z) noexcept {
    ekf_.start_moving(Filter::lean(tilt_rad), gyro_bias_B_rad_s, z);
    start_detection();
    at(Id::kEkf) = ekf_.estimate();
  }
  /// A tick of the default filter; `omega_B`: body rates before it.
  void step_filter(const Sample& z, const Vec<Robot::kInputs>& u, const Vec3& omega_B) noexcept {
    if (!params_.detection) {
      ekf_.predict(u);
      ekf_.update(z);
      return;
    }
    const int jumps = faults_.bias_jumps();
    faults_.step(ekf_, u, z, omega_B);
    if (faults_.bias_jumps() != jumps) bias_drift_.jumped();
    bias_drift_.update(faults_.healthy().gyro_biases());
    motor_error_.update(kinematics_.wheels_from_axes(ekf_.disturbance()), kinematics_.wheels_from_axes(u));
  }

  void start_detection() noexcept {
    faults_.reset(ekf_, rest_bias_.noise_rad_s().norm() / std::sqrt(3.0));
    bias_drift_.reset(ekf_.gyro_biases());
    motor_error_.reset();
  }

  Params params_;
  typename Robot::Kinematics kinematics_;
  Filter ekf_;
  SensorFaults<Filter, Robot::kWheels> faults_;
  SlowDrift<Filter::kBiases> bias_drift_;
  MotorError<Robot::kWheels> motor_error_;
  RestTilt rest_tilt_;
  RestBias rest_bias_;
  std::array<Estimate, kCount> estimates_{};
};

}  // namespace equipoise
