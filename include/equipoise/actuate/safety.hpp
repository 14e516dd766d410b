// The only place that decides whether motors may run. In: wanted duties, robot-neutral state, sensor flags,
// command
// -> out: what the bridges get, and why not. Motors start disarmed; they arm on request while everything is
// well, and any fault disarms them in the same tick. After a fault the request has to be withdrawn and made
// again. RT-safe.
#pragma once

#include <cstdint>

#include "equipoise/samples.hpp"

namespace equipoise {

enum class ArmState : std::int32_t { kDisarmed = 0, kArmed = 1, kFault = 2 };

/// Why the motors are off, as bits; names are stable (telemetry, CLI, CAN). docs/safety.md
enum SafetyReason : std::uint32_t {
  kNotRequested = 1u << 0,
  kTilt = 1u << 1,
  kImuStale = 1u << 2,
  kEncoderStale = 1u << 3,
  kNotFinite = 1u << 4,
  kBatteryLow = 1u << 5,
  kAttitudeStale = 1u << 6,
  kGyroMoving = 1u << 7,
  kSaturated = 1u << 8,  // for longer than the timeout: the robot is lost, or something holds it
  kPickedUp = 1u << 9,   // wheels that run away have no ground
  kEncoderStuck = 1u << 10,
  kEncoderReversed = 1u << 11,
  kWheelOne = 1u << 12,  // which, with the two above
  kWheelTwo = 1u << 13,
  kWheelThree = 1u << 14,
  kWheelFour = 1u << 15,
};

struct SafetyParams {
  double max_tilt_rad = 0.60;       // beyond it the wheels cannot catch the body
  double max_arm_tilt_rad = 0.20;   // and to start
  double max_arm_rate_rad_s = 2.0;  // body rate at which arming is refused
  int max_missed_samples = 2;       // consecutive ticks without a valid IMU or encoder sample
  int max_attitude_age_ticks = 10;  // where the controller needs the attitude source
  bool needs_attitude = false;
  double min_battery_V = 6.0;       // two LiPo cells; sampled over kBatteryTicks
  bool encoder_check = true;        // over the first half second after arming
  int max_saturated_ticks = 100;    // consecutive
  double pick_up_rate_rad_s = 1e9;  // of phi
  int pick_up_ticks = 40;           // consecutive, above that rate
};

struct SafetyInputs {
  StateView state;
  bool imu_ok = false;
  bool encoders_ok = false;
  bool battery_ok = false;
  bool attitude_ok = false;
  double battery_V = 0.0;
  bool all_finite = false;  // of everything the tick computed
  bool arm_requested = false;
  bool saturated = false;
  std::uint32_t encoders_stuck = 0;  // bit per wheel
  std::uint32_t encoders_reversed = 0;
};

class Safety {
 public:
  explicit Safety(const SafetyParams& params) : p_(params) {}

  MotorCommand gate(const MotorCommand& wanted, const SafetyInputs& in) noexcept;

  ArmState state() const noexcept { return state_; }
  std::uint32_t reasons() const noexcept { return reasons_; }
  bool armed() const noexcept { return state_ == ArmState::kArmed; }

 private:
  std::uint32_t faults(const SafetyInputs& in) noexcept;

  static constexpr int kBatteryTicks = 100;  // 0.5 s below the limit
  SafetyParams p_;
  ArmState state_ = ArmState::kDisarmed;
  std::uint32_t reasons_ = kNotRequested;
  int imu_missed_ = 0;
  int encoders_missed_ = 0;
  int attitude_age_ = 0;
  int battery_low_ = 0;
  std::uint32_t fault_reasons_ = 0;  // why it faulted: kept until the request is withdrawn
  int saturated_ = 0;
  int running_away_ = 0;
};

}  // namespace equipoise
