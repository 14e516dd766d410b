#include "equipoise/plant/switched_motor.hpp"

#include <algorithm>

namespace equipoise {

void SwitchedMotor::period(double u, double supply_V) noexcept {
  const double T = 1.0 / p_.pwm_hz;
  const double v = std::min(std::abs(u), 1.0);
  double on = v * T;
  // Full and zero duty do not switch; between them the delays lengthen or shorten the pulse.
  if (v > 0.0 && v < 1.0) on = std::clamp(on + p_.on_time_shift_s, 0.0, T);
  run(Phase::kOn, u < 0.0 ? -1.0 : 1.0, on, supply_V);
  run(Phase::kOff, 0.0, T - on, supply_V);
}

void SwitchedMotor::run(Phase phase, double sign, double duration_s, double supply_V) noexcept {
  if (duration_s <= 0.0) return;
  const int slices = std::max(1, static_cast<int>(std::ceil(duration_s / kMaxSlice_s)));
  for (int i = 0; i < slices; ++i) slice(phase, sign, duration_s / slices, supply_V);
}

void SwitchedMotor::slice(Phase phase, double sign, double duration_s, double supply_V) noexcept {
  const double closed_ohm = p_.resistance_ohm + p_.switch_resistance_ohm;
  const double emf = p_.torque_constant_N_m_A * speed_rad_s_;
  const double before = charge_C_;
  if (phase == Phase::kOn) {
    conduct(sign * supply_V - emf, closed_ohm, duration_s, false);
    supply_charge_C_ += sign * (charge_C_ - before);
  } else if (p_.bridge == BridgeType::kDriveBrake) {
    conduct(-emf, closed_ohm, duration_s, false);
  } else {
    // All switches open: the diodes pass what flows into the supply until it has died; only a back-EMF above
    // the supply starts it again.
    const double opposing = supply_V + 2.0 * p_.diode_drop_V;
    double direction = current_A_ > 0.0 ? 1.0 : (current_A_ < 0.0 ? -1.0 : 0.0);
    double left = duration_s;
    if (direction != 0.0) left = conduct(-direction * opposing - emf, p_.resistance_ohm, duration_s, true);
    if (left > 0.0 && std::abs(emf) > opposing) {
      direction = emf > 0.0 ? -1.0 : 1.0;
      conduct(-direction * opposing - emf, p_.resistance_ohm, left, false);
    }
    supply_charge_C_ -= std::abs(charge_C_ - before);
  }
  turn(charge_C_ - before, duration_s);
}

/// Applies a constant voltage; with `until_zero` ends when the current dies. Returns the time that is left.
double SwitchedMotor::conduct(double voltage_V, double resistance_ohm, double duration_s,
                              bool until_zero) noexcept {
  const double tau = p_.inductance_H / resistance_ohm;
  const double end = voltage_V / resistance_ohm;
  double time = duration_s;
  bool dies = false;
  if (until_zero && current_A_ * end <= 0.0 && end != 0.0) {
    const double death = tau * std::log1p(-current_A_ / end);
    dies = death <= duration_s;
    time = std::min(death, duration_s);
  }
  const double fraction = -std::expm1(-time / tau);
  charge_C_ += end * time + (current_A_ - end) * tau * fraction;
  current_A_ = dies ? 0.0 : current_A_ + (end - current_A_) * fraction;
  return duration_s - time;
}

/// The shaft over one slice: motor torque, viscous friction, and Coulomb friction that stops but never
/// drives.
void SwitchedMotor::turn(double charge_C, double duration_s) noexcept {
  const double before = speed_rad_s_;
  if (!held_) {
    const double impulse = p_.torque_constant_N_m_A * charge_C - p_.viscous_N_m_s * before * duration_s;
    const double free = before + impulse / p_.inertia_kg_m2;
    const double stop = p_.coulomb_N_m * duration_s / p_.inertia_kg_m2;
    speed_rad_s_ = free - std::clamp(free, -stop, stop);
  }
  angle_rad_ += 0.5 * (before + speed_rad_s_) * duration_s;
}

}  // namespace equipoise
