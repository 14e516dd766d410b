// The only place that decides whether motors may run. In: wanted duties, robot-neutral state, flags of
// sensors and runtime -> out: what the bridges get, and why not. Motors start disarmed and arm on request
// while every check passes; any failing check disarms in the same tick and is latched until the request is
// withdrawn. One exception: after a short stall of the loop the robot stays armed and lets go for the tick,
// which tells a guard that has cut in that the loop means what it asks for next. States and transitions:
// kArmTransitions; reasons: safety_reasons.hpp. RT-safe.
#pragma once

#include "equipoise/actuate/safety_reasons.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

enum class ArmState : std::int32_t { kDisarmed = 0, kArmed = 1, kFault = 2 };

/// A row applies when the motors are (not) requested and the checks (do not) pass; the first that applies is
/// taken, none keeps the state.
struct ArmTransition {
  enum class If { kYes, kNo, kAny };
  ArmState from;
  If requested;
  If well;
  ArmState to;
};
inline constexpr std::array<ArmTransition, 4> kArmTransitions{{
    {ArmState::kDisarmed, ArmTransition::If::kYes, ArmTransition::If::kYes, ArmState::kArmed},
    {ArmState::kArmed, ArmTransition::If::kAny, ArmTransition::If::kNo, ArmState::kFault},
    {ArmState::kArmed, ArmTransition::If::kNo, ArmTransition::If::kYes, ArmState::kDisarmed},
    {ArmState::kFault, ArmTransition::If::kNo, ArmTransition::If::kAny, ArmState::kDisarmed},
}};

struct SafetyParams {
  double max_tilt_rad = 0.60;      // beyond it the wheels cannot catch the body
  double max_arm_tilt_rad = 0.20;  // and to start
  // Tilt plus its rate times the fall's time constant, where a body that falls is going (capture point).
  double max_fall_rad = 0.60;
  double fall_time_s = 0.12;
  double max_arm_rate_rad_s = 2.0;  // body rate at which arming is refused
  int max_missed_samples = 2;  // consecutive ticks without a valid IMU or encoder sample, for estimators that
                               // cannot do without
  int max_missed_imu = 30;     // for those that bridge a gap by their model: IMU,
  int max_missed_encoders = 30;     // encoders,
  int max_missed_both = 8;          // both
  int max_stalled_ticks = 13;       // from a tick to the next, with the motors let go meanwhile
  int max_identical_samples = 3;    // of the IMU, which is noisy; 0: may stand still (noiseless simulation)
  int max_attitude_age_ticks = 10;  // where the controller needs the attitude source
  bool needs_attitude = false;
  double min_battery_V = 6.0;     // for half a second: two LiPo cells
  double cutoff_battery_V = 5.5;  // for five ticks: the supply is going
  bool detection = true;          // false: no sensor and no motor is doubted; simulation only, for twin runs
  double max_innovation = 2.5;    // normalised innovation, mean over about ten ticks; back below a half: well
  double max_innovation_published = 20.0;  // the same for [T]'s own filter, which trusts itself more
  double max_innovation_s = 0.05;          // above it for longer
  double encoder_check_drive = 0.3;    // shakes each wheel right after arming; 0: encoders are not checked
  double encoder_probe_drive = 0.0;    // turns a robot whose encoders count nothing; 0: they are believed
  double max_tilt_sigma_rad = 0.1;     // the tilt is not known any more
  double max_bias_drift_rad_s = 0.1;   // of the gyro, against its mean over 20 s
  double max_motor_error = 0.75;       // duty by which a motor does other than told, as estimated
  double max_wheel_rate_rad_s = 90.0;  // wheels without load, beside the robot's turn: picked up
  double max_stall_s = 0.3;            // a wheel that stands still at nearly full duty
  double command_timeout_s = 0.5;      // older: ramp to a stop, do not arm
};

struct SafetyInputs {
  StateView state;
  bool imu_ok = false;        // valid and new
  int ticks = 1;              // since the last tick, by the loop's clock
  bool bridges_gaps = false;  // the estimator's model can do without samples for a while
  bool imu_trusted = true;
  bool gyro_bias_known = true;  // the robot has been at rest
  bool encoders_ok = false;
  bool encoder_jump = false;  // more often than may be
  bool battery_ok = false;
  bool attitude_ok = false;
  bool bridge_fault = false;  // a bridge complains
  double battery_V = 0.0;
  double accel_m_s2 = 0.0;        // magnitude of gravity minus acceleration
  double tilt_sigma_rad = 0.0;    // the estimator's own; 0 where it does not tell
  double bias_drift_rad_s = 0.0;  // likewise
  double motor_error = 0.0;       // likewise
  std::array<double, kMaxMotors> wheel_rate_rad_s{};
  std::array<double, kMaxMotors> turn_rad_s{};  // of it, what the robot's own turn makes
  std::uint32_t left_out = 0;  // bits of sensors that were found out and are not used any more
  bool all_finite = false;     // of everything the tick computed
  bool arm_requested = false;
  double command_age_s = 0.0;
  std::uint32_t inhibit = 0;  // SafetyReason bits of the runtime: guard, real time, overruns, calibration
  bool encoders_in_check = false;    // wheels are being shaken
  std::uint32_t encoders_stuck = 0;  // bit per wheel
  std::uint32_t encoders_reversed = 0;
};

class Safety {
 public:
  explicit Safety(const SafetyParams& params) : p_(params) {}

  MotorCommand gate(const MotorCommand& wanted, const SafetyInputs& in) noexcept;

  /// A command that nobody renews asks for a stop; the reference ramps.
  Command timely(const Command& command) const noexcept;

  ArmState state() const noexcept { return state_; }
  /// What stands against arming now and, in a fault, what caused it.
  std::uint32_t reasons() const noexcept { return reasons_ | latched_; }
  bool armed() const noexcept { return state_ == ArmState::kArmed; }
  const SafetyParams& params() const noexcept { return p_; }

 private:
  std::uint32_t check_sensors(const SafetyInputs& in) noexcept;
  std::uint32_t check_motion(const SafetyInputs& in) noexcept;
  bool tolerates(const SafetyInputs& in) noexcept;
  std::uint32_t check_drive(const MotorCommand& wanted, const SafetyInputs& in) noexcept;
  void transition(bool requested, bool well) noexcept;

  SafetyParams p_;
  ArmState state_ = ArmState::kDisarmed;
  std::uint32_t reasons_ = kNotRequested;
  std::uint32_t latched_ = 0;
  int imu_missed_ = 0;
  int encoders_missed_ = 0;
  int both_missed_ = 0;
  int since_stall_ = 1 << 20;
  int attitude_age_ = 0;
  int battery_low_ = 0;
  int battery_gone_ = 0;
  int battery_unknown_ = 0;
  int bridge_faults_ = 0;
  int fast_ = 0;
  int falling_ = 0;
  std::array<int, kMaxMotors> stalled_{};
  double innovation_ = 0.0;
  std::uint32_t left_out_ = 0;
  int surprised_ = 0;
  bool unhealthy_ = false;
};

}  // namespace equipoise
