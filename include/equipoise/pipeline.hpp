// One tick, 200 Hz, top to bottom: samples in, motor commands out. The only place that joins the stages.
// In: RawSample, Command -> out: TickResult (what the bridges get and everything on the way).
// Source: [T] Fig. 6.1, 6.2. RT-safe: fixed size, no allocation, no locks, bounded.
#pragma once

#include <algorithm>

#include "equipoise/actuate/bridge.hpp"
#include "equipoise/actuate/encoder_check.hpp"
#include "equipoise/actuate/safety.hpp"
#include "equipoise/control/friction.hpp"
#include "equipoise/robot_contract.hpp"
#include "equipoise/sense/attitude_filter.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "equipoise/sense/freshness.hpp"
#include "equipoise/sense/rotor_speed.hpp"

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
  std::uint32_t reasons = 0;  // SafetyReason bits
  std::uint32_t inhibit = 0;  // those of them that the runtime asked for
};

template <class Robot, class Estimators, class Reference, class Feedback>
class Pipeline : RobotContract<Robot, Estimators, Reference, Feedback> {
 public:
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
        estimators_(p.estimators),
        reference_(p.reference),
        feedback_(p.feedback),
        bridge_(p.motor),
        freshness_(freshness_params(p)),
        safety_(p.safety),
        attitude_(p.attitude),
        encoder_check_(p.safety.encoder_check_drive) {}

  /// `inhibit`: SafetyReason bits of the runtime (guard, overruns, ...) that forbid motors.
  Result tick(const RawSample& raw, const Command& asked, std::uint32_t inhibit = 0) noexcept {
    Result t;
    const Fresh fresh = freshness_.update(raw);
    const Command command = safety_.timely(asked);
    t.z = calibrate<Robot::kWheels>(raw, p_.calibration);  // counts -> SI, body axes
    t.z.imu_ok = fresh.imu;
    t.z.attitude_ok = fresh.attitude;
    t.z.wheel_rate_rad_s = rotor_speed_.update(t.z.wheel_angle_rad);
    if (p_.attitude.own) apply(attitude_, t.z);  // in place of the packets

    t.x_hat = estimators_.update(t.z, u_previous_, !safety_.armed());  // [T] ch. 3, 6.1
    if (!safety_.armed()) reference_.reset(t.x_hat);
    t.ref = reference_.update(command, t.x_hat);  // [T] 6.2.1
    const EncoderFaults faults = encoder_check_.update(safety_.armed(), duty_previous_, t.z.wheel_angle_rad);
    t.u_lin = feedback_.update(t.ref) + kinematics_.axes_from_wheels(encoder_check_.drive());  // [T] (6.10)
    const Input friction = kinematics_.friction_input(p_.friction, t.z.wheel_rate_rad_s);
    t.u_friction = t.u_lin + friction;            // [T] 6.2.2
    const MotorCommand duty = invert_bridges(t);  // [T] 6.2.3, ch. 4
    SafetyInputs checks = safety_inputs(raw, asked, t, faults);
    checks.imu_gap = fresh.imu_gap;
    checks.encoder_jump = fresh.encoder_jump;
    checks.slip_rad_s = slip_rad_s<Robot>(t, kinematics_, 0);
    checks.inhibit = inhibit;
    t.motors = safety_.gate(duty, checks);
    t.arm_state = safety_.state();
    t.reasons = safety_.reasons();
    t.inhibit = inhibit;

    u_previous_ = applied_input(t, friction);
    duty_previous_ = wheel_duty(t.motors);
    return t;
  }

  Estimators& estimators() noexcept { return estimators_; }
  const Estimators& estimators() const noexcept { return estimators_; }
  const Params& params() const noexcept { return p_; }

 private:
  MotorCommand invert_bridges(Result& t) const noexcept {
    const double supply = bridge_.supply_V(t.z.battery_V, t.z.battery_ok);
    const Wheels u = kinematics_.wheels_from_axes(t.u_friction);
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
  /// the supply allowed it; with coasting motors, the input that just cancels the back-EMF.
  Input applied_input(const Result& t, const Input& friction) const noexcept {
    if (!t.motors.enable) {
      return kinematics_.axes_from_wheels(t.z.wheel_rate_rad_s / p_.motor.no_load_rad_s(p_.motor.nominal_V));
    }
    if (!t.saturated) return t.u_lin;
    const double share = bridge_.supply_V(t.z.battery_V, t.z.battery_ok) / p_.motor.nominal_V;
    const Wheels limited = kinematics_.wheels_from_axes(t.u_friction).cwiseMax(-share).cwiseMin(share);
    return kinematics_.axes_from_wheels(limited) - friction;
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

  SafetyInputs safety_inputs(const RawSample& raw, const Command& command, const Result& t,
                             const EncoderFaults& faults) const noexcept {
    SafetyInputs in;
    in.state = view(t.x_hat, p_.robot);
    in.imu_ok = t.z.imu_ok;
    in.encoders_ok = t.z.encoders_ok;
    in.battery_ok = t.z.battery_ok;
    in.attitude_ok = t.z.attitude_ok;
    in.battery_V = t.z.battery_V;
    in.accel_m_s2 = t.z.accel_B_m_s2.norm();
    for (int i = 0; i < Robot::kWheels; ++i) {
      in.wheel_rate_rad_s[static_cast<std::size_t>(i)] = t.z.wheel_rate_rad_s(i);
    }
    in.saturated = t.saturated;
    in.command_age_s = command.age_s;
    in.arm_requested = command.arm;
    in.encoders_in_check = encoder_check_.running();
    in.encoders_stuck = faults.stuck;
    in.encoders_reversed = faults.reversed;
    in.all_finite = finite(raw) && command.velocity_W_m_s.allFinite() &&
                    std::isfinite(command.yaw_rate_rad_s) && std::isfinite(command.age_s) &&
                    in.state.theta_rad.allFinite() && in.state.omega_B_rad_s.allFinite() &&
                    in.state.phi_rad.allFinite() && in.state.phi_dot_rad_s.allFinite() &&
                    t.u_friction.allFinite();
    return in;
  }

  static FreshnessParams freshness_params(const Params& p) noexcept {
    FreshnessParams f;
    f.max_identical_samples = p.safety.max_identical_samples;
    f.max_missed_samples = p.safety.max_missed_samples;
    // Half as fast again as a wheel without load, and a count of rounding.
    const double fastest_rad_s = 1.5 * p.motor.no_load_rad_s(p.motor.nominal_V);
    f.max_counts_per_tick = 1.0 + p.calibration.encoder_counts_per_rev / (2.0 * kPi) * fastest_rad_s * kTickS;
    return f;
  }

  /// Encoders against gyro, of robots that can tell.
  template <class R>
  static auto slip_rad_s(const Result& t, const typename R::Kinematics& kinematics, int) noexcept
      -> decltype(R::slip_rad_s(t.z, kinematics, t.x_hat)) {
    return R::slip_rad_s(t.z, kinematics, t.x_hat);
  }
  template <class R>
  static double slip_rad_s(const Result&, const typename R::Kinematics&, long) noexcept {
    return 0.0;
  }

  static bool finite(const RawSample& raw) noexcept {
    const auto all = [](const auto& values) {
      return std::all_of(std::begin(values), std::end(values), [](double v) { return std::isfinite(v); });
    };
    return all(raw.gyro_counts) && all(raw.accel_counts) && all(raw.encoder_counts) &&
           all(raw.attitude_wxyz) && std::isfinite(raw.battery_counts);
  }

  Params p_;
  typename Robot::Kinematics kinematics_;
  RotorSpeed<Robot::kWheels> rotor_speed_;
  Estimators estimators_;
  Reference reference_;
  Feedback feedback_;
  Bridge bridge_;
  Freshness freshness_;
  Safety safety_;
  AttitudeFilter attitude_;
  EncoderCheck<Robot::kWheels> encoder_check_;
  Wheels duty_previous_ = Wheels::Zero();
  Input u_previous_ = Input::Zero();
};

}  // namespace equipoise
