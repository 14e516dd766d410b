// One tick, 200 Hz, top to bottom: samples in, motor commands out. The only place that joins the stages.
// In: RawSample, Command -> out: TickResult (what the bridges get and everything on the way).
// Source: [T] Fig. 6.1, 6.2. RT-safe: fixed size, no allocation, no locks, bounded.
#pragma once

#include "equipoise/actuate/bridge.hpp"
#include "equipoise/actuate/degraded.hpp"
#include "equipoise/actuate/encoder_probe.hpp"
#include "equipoise/actuate/safety_inputs.hpp"
#include "equipoise/control/friction.hpp"
#include "equipoise/estimate/health.hpp"
#include "equipoise/robot_contract.hpp"
#include "equipoise/sense/senses.hpp"

namespace equipoise {

template <class Robot, class Reference>
struct TickResult {
  typename Robot::Sample z;
  typename Robot::Estimate x_hat;
  typename Reference::Reference ref;
  Vec<Robot::kInputs> u_lin = Vec<Robot::kInputs>::Zero();       // of a linear, frictionless drive
  Vec<Robot::kInputs> u_friction = Vec<Robot::kInputs>::Zero();  // with friction compensation
  MotorCommand motors{};
  bool saturated = false;
  ArmState arm_state = ArmState::kDisarmed;
  std::uint32_t reasons = 0;   // SafetyReason bits
  std::uint32_t inhibit = 0;   // those of them that the runtime asked for
  std::uint32_t degraded = 0;  // DegradedBit: what the robot does without
  FaultEvidence faults;
};

template <class Robot, class Estimators, class Reference, class Feedback>
class Pipeline : RobotContract<Robot, Estimators, Reference, Feedback> {
 public:
  using RobotType = Robot;
  using Input = Vec<Robot::kInputs>;
  using Wheels = Vec<Robot::kWheels>;
  using Result = TickResult<Robot, Reference>;

  struct Params {
    typename Robot::Parameters robot;
    Calibration calibration;
    typename Estimators::Params estimators;
    typename Reference::Params reference;
    typename Feedback::Params feedback;
    FrictionCompensation friction;
    MotorParameters motor;
    SafetyParams safety;
    AttitudeFilterParams attitude;
  };

  explicit Pipeline(const Params& p)
      : p_(p),
        kinematics_(p.robot),
        senses_(p.calibration, freshness_params(p), p.attitude),
        estimators_(p.estimators),
        reference_(p.reference),
        feedback_(p.feedback),
        encoder_check_(estimators_.isolates() ? 0.0 : p.safety.encoder_check_drive),
        encoder_probe_(p.safety.encoder_probe_drive),
        bridge_(p.motor),
        safety_(p.safety) {}

  Result tick(const RawSample& raw, const Command& asked, const LoopState& loop) noexcept;

  /// What acted since the last tick, where somebody else drives the motors (a log, another tuning): `u` as
  /// the estimators' linear model has it; `held`: motors off. Given before the tick, in place of its own.
  void applied(const Input& u, bool held) noexcept {
    u_previous_ = u;
    held_ = held;
  }
  const Input& applied() const noexcept { return u_previous_; }
  bool held() const noexcept { return held_; }

  Estimators& estimators() noexcept { return estimators_; }
  const Estimators& estimators() const noexcept { return estimators_; }
  const Params& params() const noexcept { return p_; }

 private:
  /// Where the robot should be; while the motors are off, where it is.
  typename Reference::Reference follow(const Command& command,
                                       const typename Robot::Estimate& x_hat) noexcept {
    if (!safety_.armed()) reference_.reset(x_hat);
    return reference_.update(command, x_hat);
  }

  /// The model runs on through missed ticks. The bridges held the last command until the guard let go, if it
  /// did; then the motors coasted. A stall that safety will not tolerate is not worth the time.
  void bridge_gap(const typename Robot::Sample& z, std::uint32_t inhibit) noexcept {
    const bool overrun = (inhibit & kOverrun) != 0;
    if (held_ || (overrun && (z.ticks > p_.safety.max_stalled_ticks || !health_.predicts_wheels))) return;
    typename Robot::Sample nothing = z;
    nothing.imu_ok = nothing.encoders_ok = nothing.attitude_ok = false;
    for (int missed = 1; missed < z.ticks; ++missed) {
      estimators_.update(nothing, u_previous_, false);
      if (!overrun || missed < kGuardTicks) continue;
      health_ = estimators_.health();
      u_previous_ = coasting(health_.wheel_rate_rad_s);
    }
  }

  /// The model's rate stands in for an encoder that is not to be had.
  std::uint32_t do_without(typename Robot::Sample& z) noexcept {
    wheel_rate_rad_s_ = z.wheel_rate_rad_s;
    if (!safety_.armed()) return 0;
    std::uint32_t degraded = health_.lost * kWithoutWheelOne;
    if (!z.imu_ok) degraded |= kWithoutImu;
    if (health_.gyro_left_out) degraded |= kWithoutGyroAxis;
    if (health_.gyro_bias_jumped) degraded |= kGyroBiasJumped;
    if (!z.encoders_ok) degraded |= kWithoutEncoders;
    for (int i = 0; i < Robot::kWheels && health_.predicts_wheels; ++i) {
      const bool lost = !z.encoders_ok || (health_.lost >> i & 1U) != 0;
      if (lost) z.wheel_rate_rad_s(i) = health_.wheel_rate_rad_s(i);
    }
    wheel_rate_rad_s_ = health_.predicts_wheels ? health_.wheel_rate_rad_s : z.wheel_rate_rad_s;
    return degraded;
  }

  Input encoder_stimulus(const typename Robot::Sample& z) noexcept {
    return kinematics_.axes_from_wheels(
        encoder_check_.update(safety_.armed(), duty_previous_, z.wheel_angle_rad));
  }

  /// Turns the robot on the spot where no encoder counts, which standing still does not explain; on a robot
  /// that does not turn, about its only input. Friction may hold the wheels, so the estimators are not told.
  Input encoder_excitation(const typename Robot::Sample& z, const Input& u) noexcept {
    constexpr int kLast = Robot::kInputs - 1;
    Input excitation = Input::Zero();
    excitation(kLast) = encoder_probe_.update(safety_.armed(), z, u(kLast));
    return excitation;
  }

  Wheels within_supply(const Input& u, double limit) const noexcept {
    if constexpr (Feedback::kSharesDuty) {
      return kinematics_.allocate(u, limit);  // balance before yaw before travel
    } else {
      return kinematics_.wheels_from_axes(u).cwiseMax(-limit).cwiseMin(limit);
    }
  }

  MotorCommand invert_bridges(Result& t) const noexcept {
    const double supply = bridge_.supply_V(t.z.battery_V, t.z.battery_ok);
    const double limit = supply / p_.motor.nominal_V;
    const Wheels asked = kinematics_.wheels_from_axes(t.u_friction);
    t.saturated = asked.cwiseAbs().maxCoeff() > limit;
    const Wheels u = t.saturated ? within_supply(t.u_friction, limit) : asked;
    MotorCommand motors{};
    for (int i = 0; i < Robot::kWheels; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double duty = bridge_.invert(u(i), t.z.wheel_rate_rad_s(i), supply);
      t.saturated = t.saturated || !(std::abs(duty) < 1.0);
      motors.duty[k] = p_.calibration.motor_sign[k] * duty;
    }
    return motors;
  }

  /// What the estimators' linear model has felt: the command before compensation, [T] section 6.1, as far as
  /// the supply allowed it; with coasting motors, the input that just cancels the back-EMF. `beside`: what it
  /// is not told of.
  Input applied_input(const Result& t, const Input& beside) const noexcept {
    if (!t.motors.enable) return coasting(t.z.wheel_rate_rad_s);
    if (!t.saturated) return t.u_lin;
    const double share = bridge_.supply_V(t.z.battery_V, t.z.battery_ok) / p_.motor.nominal_V;
    return kinematics_.axes_from_wheels(within_supply(t.u_friction, share)) - beside;
  }

  Input coasting(const Wheels& rate_rad_s) const noexcept {
    return kinematics_.axes_from_wheels(rate_rad_s / p_.motor.no_load_rad_s(p_.motor.nominal_V));
  }

  /// Duties in the wheels' sense.
  Wheels wheel_duty(const MotorCommand& motors) const noexcept {
    Wheels duty;
    for (int i = 0; i < Robot::kWheels; ++i) {
      const auto k = static_cast<std::size_t>(i);
      duty(i) = p_.calibration.motor_sign[k] * motors.duty[k];
    }
    return duty;
  }

  SafetyInputs checks(const Result& t, const Command& asked, std::uint32_t inhibit) const noexcept {
    SafetyInputs in = safety_inputs(t.z, view(t.x_hat, p_.robot), encoder_check_, asked);
    const Wheels turn = kinematics_.wheels_of_turn(in.state.omega_B_rad_s.z());
    for (int i = 0; i < Robot::kWheels; ++i) in.turn_rad_s[static_cast<std::size_t>(i)] = turn(i);
    in.encoders_reversed |= health_.backwards;
    in.encoders_stuck |= health_.dead;
    if (encoder_probe_.dead()) in.encoders_stuck |= (1U << Robot::kWheels) - 1U;
    in.encoders_in_check = in.encoders_in_check || health_.checking;
    in.bias_drift_rad_s = health_.bias_drift_rad_s;
    in.motor_error = health_.motor_error;
    in.left_out = t.degraded & kSensorsLeftOut;
    in.tilt_sigma_rad = health_.tilt_sigma_rad;
    in.all_finite = in.all_finite && t.u_friction.allFinite();
    in.bridges_gaps = health_.predicts_wheels;
    in.imu_trusted = health_.gyro_trusted && !t.z.accel_frozen;
    in.gyro_bias_known = health_.gyro_bias_known;
    in.inhibit = inhibit;
    return in;
  }

  static FreshnessParams freshness_params(const Params& p) noexcept {
    FreshnessParams f;
    f.max_identical_samples = p.safety.max_identical_samples;
    // Half as fast again as a wheel without load, and a count of rounding.
    const double fastest_rad_s = 1.5 * p.motor.no_load_rad_s(p.motor.nominal_V);
    f.max_counts_per_tick = 1.0 + p.calibration.encoder_counts_per_rev / (2.0 * kPi) * fastest_rad_s * kTickS;
    return f;
  }

  static constexpr int kGuardTicks =
      3;  // a loop that is silent for longer finds its motors off (runtime/heartbeat.hpp)

  Params p_;
  typename Robot::Kinematics kinematics_;
  Senses<Robot::kWheels> senses_;
  Estimators estimators_;
  Reference reference_;
  Feedback feedback_;
  EncoderCheck<Robot::kWheels> encoder_check_;
  EncoderProbe<Robot::kWheels> encoder_probe_;
  Bridge bridge_;
  Safety safety_;
  EstimatorHealth<Robot::kWheels> health_;
  Wheels duty_previous_ = Wheels::Zero();
  Wheels wheel_rate_rad_s_ = Wheels::Zero();  // as expected in the next tick
  Input u_previous_ = Input::Zero();
  bool held_ = true;
};

// Not inline: a robot's pipelines are compiled once, in its pipeline.cpp.
template <class Robot, class Estimators, class Reference, class Feedback>
auto Pipeline<Robot, Estimators, Reference, Feedback>::tick(const RawSample& raw, const Command& asked,
                                                            const LoopState& loop) noexcept -> Result {
  Result t;
  t.z = senses_.update(raw, loop.now_ns, wheel_rate_rad_s_, estimators_.reads_attitude());  // counts -> SI
  bridge_gap(t.z, loop.inhibit);                          // ticks that the loop has missed
  t.x_hat = estimators_.update(t.z, u_previous_, held_);  // [T] ch. 3, 6.1
  health_ = estimators_.health();
  t.degraded = do_without(t.z);
  t.ref = follow(limited(safety_.timely(asked), t.degraded), t.x_hat);  // [T] 6.2.1
  t.u_lin = feedback_.update(t.ref);                                    // [T] (6.10)
  t.u_lin += encoder_stimulus(t.z);  // shakes each wheel right after arming
  const Input friction = kinematics_.friction_input(p_.friction, t.z.wheel_rate_rad_s);  // [T] 6.2.2
  const Input beside = friction + encoder_excitation(t.z, t.u_lin);
  t.u_friction = t.u_lin + beside;
  const MotorCommand duty = invert_bridges(t);  // [T] 6.2.3, ch. 4
  t.motors = safety_.gate(duty, checks(t, asked, loop.inhibit));
  applied(applied_input(t, beside), !safety_.armed());
  duty_previous_ = wheel_duty(t.motors);
  t.arm_state = safety_.state();
  t.reasons = safety_.reasons();
  t.inhibit = loop.inhibit;
  t.faults = health_.evidence;
  return t;
}

}  // namespace equipoise
