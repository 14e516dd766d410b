// The simulated motors of any robot behind their bridges, and the battery that feeds them.
// In: motor command, wheel rates, supply -> out: torque at each wheel; supply current. Motors with open
// switches carry no current. Simulation only; no allocation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "equipoise/actuate/bridge.hpp"
#include "equipoise/plant/world.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

/// Outputs of a bridge that switch on later than off lose that much of each period; at full duty none
/// switches.
inline double switched_duty(double duty, double lost) noexcept {
  const double asked = std::abs(duty);
  if (lost == 0.0 || asked == 0.0 || asked >= 1.0) return duty;
  return std::copysign(std::clamp(asked - lost, 0.0, 1.0), duty);
}

template <int N>
class SimulatedMotors {
 public:
  SimulatedMotors(const MotorParameters& motor, const Calibration& calibration, const WorldParams& world)
      : motor_(motor),
        calibration_(calibration),
        open_V_(world.battery_V),
        battery_ohm_(world.battery_resistance_ohm),
        battery_V_(world.battery_V),
        torque_scale_(world.actual.torque),
        back_emf_scale_(world.actual.back_emf),
        diode_drop_V_(world.diode_drop_V),
        lost_duty_((world.bridge_on_delay_s - world.bridge_off_delay_s) * motor.pwm_hz) {
    supplied();
  }

  void command(const MotorCommand& command) noexcept {
    command_ = command;
    for (std::size_t i = 0; i < N; ++i) {
      command_.duty[i] = switched_duty(command.duty[i], lost_duty_);
      const double duty = calibration_.motor_sign[i] * command_.duty[i];
      if (motor_.bridge == BridgeType::kDriveBrake) {
        brake_[i] = duty;
      } else {
        coast_[i] = DriveCoastCommand(motor_.T_r(), duty);
      }
    }
  }
  bool enabled() const noexcept { return command_.enable; }
  double battery_V() const noexcept { return battery_V_; }

  Vec<N> torque(const Vec<N>& wheel_rate_rad_s) const noexcept {
    if (!command_.enable) return Vec<N>::Zero();  // all switches open: the current decays at once
    Vec<N> torque;
    for (int i = 0; i < N; ++i)
      torque(i) = stall_torque_N_m_ * mean_current(static_cast<std::size_t>(i), wheel_rate_rad_s(i));
    return torque;
  }

  /// The battery's terminal voltage under the mean supply current; a bridge's is |duty| times the motor
  /// current while driven.
  void update_battery(const Vec<N>& wheel_rate_rad_s) noexcept {
    if (battery_ohm_ == 0.0) return;
    double supply_A = 0.0;
    for (int i = 0; command_.enable && i < N; ++i) {
      const double u = command_.duty[i];
      const double omega_r = wheel_rate_rad_s(i) / no_load_rad_s_;
      supply_A += std::abs(u * (battery_V_ / motor_.resistance_ohm) * (u - omega_r));
    }
    battery_V_ = open_V_ - battery_ohm_ * supply_A;
    supplied();
  }

  /// Torque lost per rad/s of a wheel while its bridge drives. (5.12)
  double damping_N_m_s() const noexcept { return torque_scale_ * back_emf_scale_ * motor_.k2(); }

 private:
  /// Over the stall current. Diodes carry the current of a drive/coast bridge alone.
  double mean_current(std::size_t i, double wheel_rate_rad_s) const noexcept {
    const double omega_r = wheel_rate_rad_s / no_load_rad_s_;
    if (motor_.bridge == BridgeType::kDriveBrake) return brake_[i] - omega_r;
    return coast_[i].mean_current(omega_r, diodes_oppose_);
  }
  /// What follows from the battery's voltage.
  void supplied() noexcept {
    stall_torque_N_m_ = torque_scale_ * motor_.torque_constant_N_m_A * (battery_V_ / motor_.resistance_ohm);
    no_load_rad_s_ = battery_V_ / motor_.torque_constant_N_m_A / back_emf_scale_;
    diodes_oppose_ = 1.0 + 2.0 * diode_drop_V_ / battery_V_;
  }

  MotorParameters motor_;
  Calibration calibration_;
  double open_V_, battery_ohm_, battery_V_;
  double torque_scale_, back_emf_scale_;  // of every motor
  double diode_drop_V_;
  double lost_duty_;
  double stall_torque_N_m_ = 0.0;
  double no_load_rad_s_ = 1.0;
  double diodes_oppose_ = 1.0;
  MotorCommand command_{};
  // The commands held, each of one kind of bridge: the integrator asks at many speeds per command.
  std::array<double, N> brake_{};
  std::array<DriveCoastCommand, N> coast_{};
};

}  // namespace equipoise
