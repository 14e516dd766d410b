#include "equipoise/actuate/safety.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise {
namespace {

int count(int n, bool ok) noexcept { return ok ? 0 : std::min(n + 1, 1 << 20); }

bool finite_and_bounded(const MotorCommand& command) noexcept {
  return std::all_of(command.duty.begin(), command.duty.end(),
                     [](double d) { return std::isfinite(d) && std::abs(d) <= 1.0; });
}

}  // namespace

std::uint32_t Safety::faults(const SafetyInputs& in) noexcept {
  imu_missed_ = count(imu_missed_, in.imu_ok);
  encoders_missed_ = count(encoders_missed_, in.encoders_ok);
  attitude_age_ = count(attitude_age_, in.attitude_ok);
  battery_low_ = count(battery_low_, !(in.battery_ok && in.battery_V < p_.min_battery_V));

  std::uint32_t reasons = 0;
  const double tilt = in.state.theta_rad.head<2>().norm();
  const bool armed = state_ == ArmState::kArmed;
  if (!(tilt <= (armed ? p_.max_tilt_rad : p_.max_arm_tilt_rad))) reasons |= kTilt;
  if (imu_missed_ > (armed ? p_.max_missed_samples : 0)) reasons |= kImuStale;
  if (encoders_missed_ > (armed ? p_.max_missed_samples : 0)) reasons |= kEncoderStale;
  if (p_.needs_attitude && attitude_age_ > p_.max_attitude_age_ticks) reasons |= kAttitudeStale;
  if (battery_low_ >= kBatteryTicks) reasons |= kBatteryLow;
  // Only a driven robot saturates, runs away or shows what its encoders are worth.
  saturated_ = count(saturated_, !(armed && in.saturated));
  running_away_ = count(running_away_, !(armed && in.state.phi_dot_rad_s.norm() > p_.pick_up_rate_rad_s));
  if (saturated_ > p_.max_saturated_ticks) reasons |= kSaturated;
  if (running_away_ > p_.pick_up_ticks) reasons |= kPickedUp;
  const bool check = armed && p_.encoder_check;
  if (check && in.encoders_stuck != 0) reasons |= kEncoderStuck;
  if (check && in.encoders_reversed != 0) reasons |= kEncoderReversed;
  if (check) reasons |= (in.encoders_stuck | in.encoders_reversed) * kWheelOne;
  if (!armed && !(in.state.omega_B_rad_s.norm() <= p_.max_arm_rate_rad_s)) reasons |= kGyroMoving;
  return reasons;
}

MotorCommand Safety::gate(const MotorCommand& wanted, const SafetyInputs& in) noexcept {
  reasons_ = faults(in);
  if (!in.all_finite || !finite_and_bounded(wanted)) reasons_ |= kNotFinite;
  if (!in.arm_requested) reasons_ |= kNotRequested;

  switch (state_) {
    case ArmState::kDisarmed:
      if (reasons_ == 0) state_ = ArmState::kArmed;
      break;
    case ArmState::kArmed:
      if (reasons_ == kNotRequested) {
        state_ = ArmState::kDisarmed;
      } else if (reasons_ != 0) {
        state_ = ArmState::kFault;
        fault_reasons_ = reasons_ & ~kNotRequested;
      }
      break;
    case ArmState::kFault:
      reasons_ |= fault_reasons_;
      if (!in.arm_requested) state_ = ArmState::kDisarmed;
      break;
  }
  if (state_ != ArmState::kArmed) return {};
  MotorCommand command = wanted;
  command.enable = true;
  return command;
}

}  // namespace equipoise
