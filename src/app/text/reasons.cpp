#include "app/text/reasons.hpp"

#include "app/text/format.hpp"

namespace equipoise::app {
namespace {

using When = ReasonLimit::When;

double tilt(const ReasonNumbers& n, const SafetyParams&) { return n.tilt_rad; }
double tilt_soon(const ReasonNumbers& n, const SafetyParams& p) {
  return (n.tilt_xy_rad + p.fall_time_s * n.tilt_rate_rad_s).norm();
}
double rate(const ReasonNumbers& n, const SafetyParams&) { return n.rate_rad_s; }
double battery(const ReasonNumbers& n, const SafetyParams&) { return n.battery_V; }
double innovation(const ReasonNumbers& n, const SafetyParams&) { return n.innovation; }
double command_age(const ReasonNumbers& n, const SafetyParams&) { return n.command_age_s; }

bool beyond(const ReasonLimit& l, const ReasonNumbers& n, const SafetyParams& p) {
  if (l.when == When::kArming && n.was_armed) return false;
  if (l.when == When::kArmed && !n.was_armed) return false;
  return l.below ? l.value(n, p) < p.*l.limit : l.value(n, p) > p.*l.limit;
}

std::string explained(const Reason& reason, const ReasonNumbers& n, const SafetyParams& p) {
  for (const ReasonLimit& l : reason.limits) {
    if (!beyond(l, n, p)) continue;
    return format("%s %.2f%s, limit %.2f%s: ", l.what, l.value(n, p), l.unit, p.*l.limit, l.unit) +
           reason.remedy;
  }
  return std::string(reason.name) + ": " + reason.text + "; " + reason.remedy;
}

std::vector<std::string> names_of(const std::vector<Reason>& rows, std::uint32_t bits) {
  std::vector<std::string> names;
  for (const Reason& row : rows) {
    if ((bits & row.bit) != 0) names.emplace_back(row.name);
  }
  return names;
}

}  // namespace

const std::vector<Reason>& safety_reasons() {
  static const std::vector<Reason> rows{
      {kNotRequested, "not_requested", "no arm request",
       "send --arm, Arm in the cockpit; run --arm, or a key or a remote"},
      {kTilt,
       "tilt",
       "tilt, or tilt plus rate times safety.fall_time_s, is above its limit",
       "hold it upright before arming",
       {{When::kArming, "tilt", " rad", tilt, &SafetyParams::max_arm_tilt_rad},
        {When::kArmed, "tilt", " rad", tilt, &SafetyParams::max_tilt_rad},
        {When::kArmed, "tilt that it falls to", " rad", tilt_soon, &SafetyParams::max_fall_rad}}},
      {kImuStale, "imu_stale",
       "no new IMU sample for more than safety.max_missed_imu ticks (safety.max_missed_both without "
       "encoders, too), or safety.max_identical_samples identical ones",
       "check cable and interrupt pin of the IMU; equipoise doctor"},
      {kEncoderStale, "encoder_stale", "no new encoder counts for more than safety.max_missed_encoders ticks",
       "check the encoder cables and the eQEP overlays"},
      {kNotFinite, "not_finite", "an estimate or a command is not a number",
       "keep the log: equipoise replay LOG names the tick"},
      {kBatteryLow,
       "battery_low",
       "below safety.min_battery_V or safety.cutoff_battery_V, or not measured",
       "charge it; calibration.battery_V_per_count if a meter disagrees",
       {{When::kAlways, "battery", " V", battery, &SafetyParams::min_battery_V, true}}},
      {kAttitudeStale, "attitude_stale",
       "the chosen estimator needs attitude packets, and none came for safety.max_attitude_age_ticks ticks",
       "check the DMP image in the board file, or choose attitude.source = own"},
      {kGyroMoving,
       "gyro_moving",
       "the robot moves, or has not been at rest since power-on",
       "hold it still for a second; equipoise calibrate gyro",
       {{When::kArming, "body rate", " rad/s", rate, &SafetyParams::max_arm_rate_rad_s}}},
      {kNotCalibrated, "not_calibrated", "no calibration yet",
       "equipoise calibrate gyro, or wait for the first second at rest"},
      {kEncoderSign, "encoder_sign", "an encoder counts against its motor; of two wheels named, one does",
       "equipoise bringup finds swapped or reversed motors and encoders"},
      {kEstimatorUnhealthy,
       "estimator_unhealthy",
       "innovations above safety.max_innovation for safety.max_innovation_s, or a tilt less certain than "
       "safety.max_tilt_sigma_rad",
       "check the configuration of this robot, the IMU's mount, the wheels on the floor",
       {{When::kAlways, "normalised innovation", "", innovation, &SafetyParams::max_innovation}}},
      {kCommandStale,
       "command_stale",
       "the command to arm is older than safety.command_timeout_s",
       "check the link to the sender; clocks need not agree",
       {{When::kArming, "age of the command", " s", command_age, &SafetyParams::command_timeout_s}}},
      {kRealtimeMissing, "realtime_missing", "no real-time priority",
       "start it as the service does; equipoise doctor names the limit"},
      {kGuardDead, "guard_dead", "the guard process ended or hangs", "see the journal; restart run"},
      {kOverrun, "overrun", "a tick came later than safety.max_stalled_ticks, or ticks were late too often",
       "remove other load; equipoise bench measures it"},
      {kPickedUp, "picked_up",
       "a wheel turns faster than safety.max_wheel_rate_rad_s, the robot's own turn aside, or it falls "
       "freely",
       "put the robot down, arm again"},
      {kStall, "stall", "a wheel is driven hard and does not turn for safety.max_stall_s", "free the wheel"},
      {kSaturated, "saturated", "motors at their limit for half a second; older logs only",
       "charge the battery; lower the speed"},
      {kWheelSlip, "wheel_slip", "wheels and body disagreed; logs of 0.1 only",
       "clean floor, ball and wheels"},
      {kEncoderJump, "encoder_jump", "counts jump by more than a wheel can turn",
       "keep the cable away from motor leads; check pull-ups"},
      {kBridgeFault, "bridge_fault", "a motor driver reports a fault",
       "let it cool; look for a short circuit"},
      {kWriteFailed, "write_failed", "a duty could not be written",
       "check PWM devices and permissions; equipoise doctor"},
      {kLogFailed, "log_failed", "the log could not be written", "free disk space, or run with --log off"},
      {kEncoderStuck, "encoder_stuck", "a wheel was driven and its counts did not change",
       "check encoder cable, coupling and motor cable, motor.invert_bridge; free the wheel"},
      {kWheelOne, "wheel_1", "the message beside it concerns wheel 1", "see the message beside it"},
      {kWheelTwo, "wheel_2", "the message beside it concerns wheel 2", "see the message beside it"},
      {kWheelThree, "wheel_3", "the message beside it concerns wheel 3", "see the message beside it"},
      {kWheelFour, "wheel_4", "the message beside it concerns wheel 4", "see the message beside it"},
      {kImuUntrusted, "imu_untrusted",
       "gyro inconsistent with the other sensors or drifting by safety.max_bias_drift_rad_s, or "
       "accelerometer constant",
       "check mount and supply of the IMU; a bias: equipoise calibrate gyro"},
      {kMotorFault, "motor_fault",
       "motion does not match the motor command: a motor is off by more than safety.max_motor_error",
       "check the motor cables; equipoise bringup"},
  };
  return rows;
}

const std::vector<Reason>& degraded_modes() {
  static const std::vector<Reason> rows{
      {kWithoutImu, "without_imu", "no IMU sample: the model bridges the gap", "check the cable of the IMU"},
      {kWithoutEncoders, "without_encoders", "no encoder counts: the model bridges the gap",
       "check the encoder cables"},
      {kEstimatorInDoubt, "estimator_in_doubt", "large innovations: zero setpoint",
       "check the IMU's mount and the wheels on the floor"},
      {kWithoutWheelOne, "without_wheel_1", "the encoder of wheel 1 is faulty and excluded: at most 0.1 m/s",
       "check the encoder and its cable"},
      {kWithoutWheelTwo, "without_wheel_2", "the encoder of wheel 2 is faulty and excluded: at most 0.1 m/s",
       "check the encoder and its cable"},
      {kWithoutWheelThree, "without_wheel_3",
       "the encoder of wheel 3 is faulty and excluded: at most 0.1 m/s", "check the encoder and its cable"},
      {kWithoutWheelFour, "without_wheel_4", "the encoder of wheel 4 is faulty and excluded: at most 0.1 m/s",
       "check the encoder and its cable"},
      {kWithoutGyroAxis, "without_gyro_axis", "a gyro axis is faulty and excluded: zero setpoint",
       "check mount and supply of the IMU"},
      {kGyroBiasJumped, "gyro_bias_jumped", "a constant gyro error is subtracted: at most 0.1 m/s",
       "check mount and supply of the IMU"},
  };
  return rows;
}

ReasonNumbers reason_numbers(const runtime::TickRecord& tick) noexcept {
  const StateView x = runtime::to_view(tick.estimate);
  return {false,
          x.theta_rad.head<2>().norm(),
          x.theta_rad.head<2>(),
          x.omega_B_rad_s.head<2>(),
          x.omega_B_rad_s.norm(),
          tick.battery_V,
          x.normalized_innovation,
          tick.command_age_s};
}

std::vector<std::string> reason_names(std::uint32_t reasons) { return names_of(safety_reasons(), reasons); }
std::vector<std::string> degraded_names(std::uint32_t degraded) {
  return names_of(degraded_modes(), degraded);
}

std::string reasons_text(std::uint32_t reasons) { return joined(reason_names(reasons)); }

std::vector<std::string> reasons_explained(std::uint32_t reasons, const ReasonNumbers& numbers,
                                           const SafetyParams& limits) {
  std::vector<std::string> lines;
  for (const Reason& reason : safety_reasons()) {
    if ((reasons & reason.bit) != 0) lines.push_back(explained(reason, numbers, limits));
  }
  return lines;
}

}  // namespace equipoise::app
