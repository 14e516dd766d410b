#include "equipoise/actuate/safety.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise {
namespace {

constexpr int kBatteryTicks = 100;         // half a second below the limit
constexpr int kCutoffTicks = 5;            // tolerates one conversion's spike
constexpr int kBatteryUnknownTicks = 400;  // two seconds without a valid conversion
constexpr int kBridgeTicks = 3;   // the driver has weighed the evidence; one bad read more decides nothing
constexpr int kStallEvery = 200;  // ticks; a loop that is late more often is broken
constexpr int kLeftOutTicks = 5;  // of a surprise, with one sensor less
constexpr int kFastTicks = 10;
constexpr int kFallingTicks = 10;
constexpr double kFreeFall_m_s2 = 0.2 * kGravity_m_s2;
constexpr double kStallDuty = 0.9;
constexpr double kStallRate_rad_s = 0.5;
constexpr double kMean = 0.1;                  // of the running means: about ten ticks
constexpr double kLargestInnovation = 1000.0;  // one outlier decides nothing, and is forgotten

int count(int n, bool ok) noexcept { return ok ? 0 : std::min(n + 1, 1 << 20); }
int ticks(double seconds) noexcept { return static_cast<int>(seconds * kTickHz); }

bool finite_and_bounded(const MotorCommand& command) noexcept {
  return std::all_of(std::begin(command.duty), std::end(command.duty),
                     [](double d) { return std::isfinite(d) && std::abs(d) <= 1.0; });
}

bool applies(ArmTransition::If condition, bool value) noexcept {
  return condition == ArmTransition::If::kAny || (condition == ArmTransition::If::kYes) == value;
}

}  // namespace

std::uint32_t Safety::check_sensors(const SafetyInputs& in) noexcept {
  imu_missed_ = count(imu_missed_, in.imu_ok);
  encoders_missed_ = count(encoders_missed_, in.encoders_ok);
  attitude_age_ = count(attitude_age_, in.attitude_ok);
  battery_low_ = count(battery_low_, !(in.battery_ok && in.battery_V < p_.min_battery_V));
  battery_gone_ = count(battery_gone_, !(in.battery_ok && in.battery_V < p_.cutoff_battery_V));
  battery_unknown_ = count(battery_unknown_, in.battery_ok);

  both_missed_ = count(both_missed_, in.imu_ok || in.encoders_ok);
  const auto missable = [&](int bridged) {
    return !armed() ? 0 : in.bridges_gaps ? bridged : p_.max_missed_samples;
  };
  const bool both = both_missed_ > missable(p_.max_missed_both);
  std::uint32_t reasons = 0;
  if (imu_missed_ > missable(p_.max_missed_imu) || both) reasons |= kImuStale;
  if (encoders_missed_ > missable(p_.max_missed_encoders) || both) reasons |= kEncoderStale;
  if (!in.imu_trusted) reasons |= kImuUntrusted;
  if (armed() && !(in.bias_drift_rad_s <= p_.max_bias_drift_rad_s)) reasons |= kImuUntrusted;
  if (in.encoder_jump) reasons |= kEncoderJump;
  if (p_.needs_attitude && attitude_age_ > p_.max_attitude_age_ticks) reasons |= kAttitudeStale;
  if (battery_low_ >= kBatteryTicks || battery_gone_ >= kCutoffTicks ||
      battery_unknown_ >= kBatteryUnknownTicks) {
    reasons |= kBatteryLow;
  }
  if (armed()) {  // only a driven robot shows what its encoders are worth
    if (in.encoders_stuck != 0) reasons |= kEncoderStuck;
    if (in.encoders_reversed != 0) reasons |= kEncoderSign;
    reasons |= (in.encoders_stuck | in.encoders_reversed) * kWheelOne;
  }
  return reasons;
}

std::uint32_t Safety::check_motion(const SafetyInputs& in) noexcept {
  const double tilt = in.state.theta_rad.head<2>().norm();
  const Vec2 falls = in.state.theta_rad.head<2>() + p_.fall_time_s * in.state.omega_B_rad_s.head<2>();
  const double nis = std::min(std::abs(in.state.normalized_innovation), kLargestInnovation);
  if (std::isfinite(nis)) innovation_ += kMean * (nis - innovation_);
  // What was left out explains what was; what surprises after that is something else.
  if ((in.left_out & ~left_out_) != 0) innovation_ = 0.0;
  left_out_ = in.left_out;
  // A reversed encoder surprises the estimator, too: the check that can name the wheel goes first.
  surprised_ = count(surprised_,
                     in.encoders_in_check || !(innovation_ > (unhealthy_ ? 0.5 : 1.0) * p_.max_innovation));
  const int patience = left_out_ != 0 ? kLeftOutTicks : ticks(p_.max_innovation_s);
  unhealthy_ = surprised_ > (unhealthy_ ? 0 : patience);
  falling_ = count(falling_, !(in.imu_ok && in.accel_m_s2 < kFreeFall_m_s2));
  double fastest = 0.0;
  for (std::size_t i = 0; i < kMaxMotors; ++i)
    fastest = std::max(fastest, std::abs(in.wheel_rate_rad_s[i] - in.turn_rad_s[i]));
  fast_ = count(fast_, !(fastest > p_.max_wheel_rate_rad_s));

  std::uint32_t reasons = 0;
  if (!(tilt <= (armed() ? p_.max_tilt_rad : p_.max_arm_tilt_rad))) reasons |= kTilt;
  if (armed() && !(falls.norm() <= p_.max_fall_rad)) reasons |= kTilt;
  const bool still = in.gyro_bias_known && in.state.omega_B_rad_s.norm() <= p_.max_arm_rate_rad_s;
  if (!armed() && !still) reasons |= kGyroMoving;
  if (unhealthy_ || !(in.tilt_sigma_rad <= p_.max_tilt_sigma_rad)) reasons |= kEstimatorUnhealthy;
  if (fast_ >= kFastTicks || falling_ >= kFallingTicks) reasons |= kPickedUp;
  return reasons;
}

/// A stall that the estimator's model has bridged, and no other of late.
bool Safety::tolerates(const SafetyInputs& in) noexcept {
  const bool late = (in.inhibit & kOverrun) != 0;
  const bool rare = since_stall_ > kStallEvery;
  since_stall_ = late ? 0 : count(since_stall_, false);
  return late && rare && armed() && in.bridges_gaps && in.ticks <= p_.max_stalled_ticks;
}

std::uint32_t Safety::check_drive(const MotorCommand& wanted, const SafetyInputs& in) noexcept {
  bridge_faults_ = count(bridge_faults_, !in.bridge_fault);
  bool stalled = false;
  for (std::size_t i = 0; i < stalled_.size(); ++i) {
    const bool stands = armed() && std::abs(wanted.duty[i]) > kStallDuty &&
                        std::abs(in.wheel_rate_rad_s[i]) < kStallRate_rad_s;
    stalled_[i] = count(stalled_[i], !stands);
    stalled = stalled || stalled_[i] > ticks(p_.max_stall_s);
  }
  std::uint32_t reasons = 0;
  if (bridge_faults_ >= kBridgeTicks) reasons |= kBridgeFault;
  if (stalled) reasons |= kStall;
  if (armed() && !(in.motor_error <= p_.max_motor_error)) reasons |= kMotorFault;
  return reasons;
}

void Safety::transition(bool requested, bool well) noexcept {
  for (const ArmTransition& row : kArmTransitions) {
    if (row.from == state_ && applies(row.requested, requested) && applies(row.well, well)) {
      latched_ = row.to == ArmState::kFault ? reasons_ : 0;
      state_ = row.to;
      return;
    }
  }
}

MotorCommand Safety::gate(const MotorCommand& wanted, const SafetyInputs& in) noexcept {
  reasons_ = check_sensors(in) | check_motion(in) | check_drive(wanted, in) | in.inhibit;
  if (!in.all_finite || !finite_and_bounded(wanted)) reasons_ |= kNotFinite;
  if (!armed() && !(in.command_age_s <= p_.command_timeout_s)) reasons_ |= kCommandStale;
  const bool let_go = tolerates(in);
  const bool well = (reasons_ & ~(let_go ? kOverrun : 0U)) == 0;
  if (!in.arm_requested) reasons_ |= kNotRequested;
  transition(in.arm_requested, well);
  if (!armed() || let_go) return {};
  MotorCommand command = wanted;
  command.enable = true;
  return command;
}

Command Safety::timely(const Command& command) const noexcept {
  if (!(command.age_s > p_.command_timeout_s)) return command;
  Command stop = command;
  stop.velocity_W_m_s.setZero();
  stop.yaw_rate_rad_s = 0.0;
  return stop;
}

}  // namespace equipoise
