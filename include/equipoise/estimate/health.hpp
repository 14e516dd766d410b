// What an estimator says of itself and of its sensors, for safety and for the stages behind it. Plain values,
// RT-safe.
#pragma once

#include <cstdint>

#include "equipoise/estimate/fault_hypotheses.hpp"
#include "equipoise/types.hpp"

namespace equipoise {

template <int Wheels>
struct EstimatorHealth {
  double tilt_sigma_rad = 0.0;    // 0: not known
  std::uint32_t lost = 0;         // bit per wheel whose encoder is not used any more
  std::uint32_t backwards = 0;    // those that were found so early that they are wired backwards
  bool checking = false;          // just armed: the encoders are on trial
  std::uint32_t dead = 0;         // bits of encoders that stand still together while the robot moves
  double bias_drift_rad_s = 0.0;  // of the gyro, lately
  double motor_error = 0.0;       // duty by which a motor does other than told
  bool gyro_left_out = false;     // an axis of it
  bool gyro_bias_jumped = false;  // and is taken off since
  bool gyro_trusted = true;
  bool gyro_bias_known = true;  // found at rest, before arming
  FaultEvidence evidence;
  bool predicts_wheels = false;  // `wheel_rate_rad_s` may stand in for an encoder
  Vec<Wheels> wheel_rate_rad_s = Vec<Wheels>::Zero();
};

/// `faults`: a SensorFaults.
template <class Faults, int Wheels>
void report(const Faults& faults, EstimatorHealth<Wheels>* health) noexcept {
  const std::uint32_t wheels = faults.excluded_wheels();
  health->lost = wheels;
  health->dead = (wheels & (wheels - 1)) != 0 ? wheels : 0;
  health->backwards = faults.wired_backwards();
  health->checking = faults.suspects();
  health->gyro_left_out = faults.gyro_axis_excluded();
  health->gyro_bias_jumped = faults.bias_jumps() > 0;
  health->gyro_trusted = faults.trusted();
  health->evidence = faults.evidence();
}

}  // namespace equipoise
