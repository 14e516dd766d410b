// One brushed motor behind an H-bridge at PWM resolution. In: command u, time -> out: current, charge, speed.
// Between switching instants current is an exponential: solved in closed form, with the instant at which the
// diodes stop conducting. Speed is held within slices of at most `kMaxSlice_s`. Source: [T] (4.1)-(4.5), with
// the diode drop and the switch resistance that (4.6)-(4.30) leave out. Simulation only; allocates nothing.
#pragma once

#include "equipoise/actuate/bridge.hpp"

namespace equipoise {

struct SwitchedMotorParams {
  double resistance_ohm = 6.49;
  double inductance_H = 0.362e-3;
  double torque_constant_N_m_A = 0.133;
  double inertia_kg_m2 = 2e-3;  // rotor, gear and flywheel at the output shaft
  double coulomb_N_m = 0.0;
  double viscous_N_m_s = 0.0;

  BridgeType bridge = BridgeType::kDriveCoast;
  double pwm_hz = 20e3;
  double diode_drop_V = 0.0;           // V_d, each of the two diodes in the path
  double switch_resistance_ohm = 0.0;  // of the two closed switches together
  double on_time_shift_s = 0.0;        // turn-off delay minus turn-on delay
};

class SwitchedMotor {
 public:
  static constexpr double kMaxSlice_s = 2e-4;

  explicit SwitchedMotor(const SwitchedMotorParams& p) noexcept : p_(p) {}

  /// One PWM period with `u` and the supply held.
  void period(double u, double supply_V) noexcept;

  double current_A() const noexcept { return current_A_; }
  double speed_rad_s() const noexcept { return speed_rad_s_; }
  double angle_rad() const noexcept { return angle_rad_; }
  /// Integrals since construction: of the motor's current, and of what the supply gave.
  double charge_C() const noexcept { return charge_C_; }
  double supply_charge_C() const noexcept { return supply_charge_C_; }

  /// Holds the shaft at this speed (a dynamometer): torques no longer change it.
  void hold_speed(double speed_rad_s) noexcept {
    speed_rad_s_ = speed_rad_s;
    held_ = true;
  }

 private:
  enum class Phase { kOn, kOff };
  void run(Phase phase, double sign, double duration_s, double supply_V) noexcept;
  void slice(Phase phase, double sign, double duration_s, double supply_V) noexcept;
  double conduct(double voltage_V, double resistance_ohm, double duration_s, bool until_zero) noexcept;
  void turn(double charge_C, double duration_s) noexcept;

  SwitchedMotorParams p_;
  double current_A_ = 0.0;
  double speed_rad_s_ = 0.0;
  double angle_rad_ = 0.0;
  double charge_C_ = 0.0;
  double supply_charge_C_ = 0.0;
  bool held_ = false;
};

}  // namespace equipoise
