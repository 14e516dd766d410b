// From wanted linear duty to the bridge's command, per motor. In: u in nominal-voltage units, wheel rate,
// battery voltage -> out: duty in [-1, 1]. Scales by V_nominal/V_battery, then inverts the bridge:
// drive/brake is linear, drive/coast is [T] chapter 4. Stateless, RT-safe, bounded iterations.
#pragma once

#include <algorithm>

#include "equipoise/actuate/drive_coast.hpp"
#include "equipoise/types.hpp"

namespace equipoise {

enum class BridgeType { kDriveBrake, kDriveCoast };

/// One motor with its gear, at the output shaft. Defaults: MBBR, [T] section 6.2.3.
struct MotorParameters {
  double resistance_ohm = 3.385;
  double torque_constant_N_m_A = 0.0742;
  double inductance_H = 0.585e-3;
  double pwm_hz = 20e3;
  double nominal_V = 8.0;
  double bridge_lost_s = 0.0;  // of each period, while the outputs switch: on delay less off delay
  BridgeType bridge = BridgeType::kDriveCoast;
  bool invert_bridge = true;  // false: a linear bridge's duty, whatever the bridge; [T] section 4.6

  double stall_current_A(double supply_V) const noexcept { return supply_V / resistance_ohm; }
  double no_load_rad_s(double supply_V) const noexcept { return supply_V / torque_constant_N_m_A; }
  double lost_duty() const noexcept { return bridge_lost_s * pwm_hz; }
  double T_r() const noexcept { return resistance_ohm / (inductance_H * pwm_hz); }
  double k1() const noexcept { return torque_constant_N_m_A * stall_current_A(nominal_V); }  // (5.12)
  double k2() const noexcept { return torque_constant_N_m_A * torque_constant_N_m_A / resistance_ohm; }
};

class Bridge {
 public:
  explicit Bridge(const MotorParameters& motor) : motor_(motor), inverse_(motor.T_r()) {}

  /// A battery reading outside this range is not believed and the nominal voltage taken instead.
  static constexpr double kMinShareOfNominal = 0.5;
  static constexpr double kMaxShareOfNominal = 1.5;

  double supply_V(double battery_V, bool battery_ok) const noexcept {
    const bool plausible = battery_ok && battery_V > kMinShareOfNominal * motor_.nominal_V &&
                           battery_V < kMaxShareOfNominal * motor_.nominal_V;
    return plausible ? battery_V : motor_.nominal_V;
  }

  /// `u`: duty of a linear bridge at nominal voltage.
  double invert(double u, double wheel_rate_rad_s, double supply) const noexcept {
    const double scaled = u * motor_.nominal_V / supply;
    if (motor_.bridge == BridgeType::kDriveBrake || !motor_.invert_bridge) return saturate(scaled);
    const double omega_r = wheel_rate_rad_s / motor_.no_load_rad_s(supply);
    if (!std::isfinite(scaled - omega_r)) return scaled - omega_r;  // for the safety gate to see
    const double duty = inverse_.solve(std::clamp(omega_r, -1.0, 1.0), scaled - omega_r).u;
    return duty == 0.0 ? duty : saturate(duty + std::copysign(motor_.lost_duty(), duty));
  }

  static double saturate(double u) noexcept { return u > 1.0 ? 1.0 : (u < -1.0 ? -1.0 : u); }

 private:
  MotorParameters motor_;
  DriveCoastInverse inverse_;
};

}  // namespace equipoise
