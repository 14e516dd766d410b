// The simulated motors of any robot behind their bridges, and the battery that feeds them.
// In: motor command, wheel rates, supply -> out: torque at each wheel; supply current. Motors with open
// switches carry no current. Simulation only; no allocation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "equipoise/actuate/bridge.hpp"
#include "equipoise/plant/diode_drop.hpp"
#include "equipoise/plant/world.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

/// The bridges of a robot whose diodes drop nothing, under the commands that they hold. A command of a
/// drive/brake bridge is its duty.
template <class Real, int N>
struct BridgesOf {
  std::array<DriveCoastCommandOf<Real>, N> coast{};  // the integrator asks at many speeds per command
  std::array<Real, N> brake{};
  Real stall_torque_N_m{0.0};
  Real no_load_rad_s{1.0};

  VecOf<Real, N> torque(BridgeType type, const VecOf<Real, N>& wheel_rate_rad_s) const noexcept {
    VecOf<Real, N> torque;
    for (int i = 0; i < N; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Real omega_r = wheel_rate_rad_s(i) / no_load_rad_s;
      torque(i) = stall_torque_N_m *
                  (type == BridgeType::kDriveBrake ? brake[k] - omega_r : coast[k].mean_current(omega_r));
    }
    return torque;
  }
};

/// The battery that feeds them, as the bridges of one robot draw on it.
template <class Real, int N>
struct SupplyOf {
  Real open_V, resistance_ohm, battery_V;
  Real motor_ohm, torque_constant_N_m_A, torque_scale, back_emf_scale;  // of every motor

  /// Terminal voltage under the mean supply current; a bridge's is |duty| times the motor current while
  /// driven.
  template <class Duty>
  void draw(const Duty& duty, const VecOf<Real, N>& wheel_rate_rad_s, BridgesOf<Real, N>* bridges) noexcept {
    using std::abs;
    Real supply_A(0.0);
    for (int i = 0; i < N; ++i) {
      const Real u(duty[i]);
      const Real omega_r = wheel_rate_rad_s(i) / bridges->no_load_rad_s;
      supply_A += abs(u * (battery_V / motor_ohm) * (u - omega_r));
    }
    battery_V = open_V - resistance_ohm * supply_A;
    feed(bridges);
  }
  /// What follows from the battery's voltage.
  void feed(BridgesOf<Real, N>* bridges) const noexcept {
    bridges->stall_torque_N_m = torque_scale * torque_constant_N_m_A * (battery_V / motor_ohm);
    bridges->no_load_rad_s = battery_V / torque_constant_N_m_A / back_emf_scale;
  }
};

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
        supply_{world.battery_V,      world.battery_resistance_ohm, world.battery_V,
                motor.resistance_ohm, motor.torque_constant_N_m_A,  world.actual.torque,
                world.actual.back_emf},
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
        bridges_.brake[i] = duty;
      } else if (diode_drop_V_ == 0.0) {
        bridges_.coast[i] = DriveCoastCommand(motor_.T_r(), duty);
      } else {
        held_with_drop_[i] = DriveCoastDropCommand(motor_.T_r(), duty);
      }
    }
  }
  bool enabled() const noexcept { return command_.enable; }
  double battery_V() const noexcept { return supply_.battery_V; }

  Vec<N> torque(const Vec<N>& wheel_rate_rad_s) const noexcept {
    if (!command_.enable) return Vec<N>::Zero();  // all switches open: the current decays at once
    if (!drops()) return bridges_.torque(motor_.bridge, wheel_rate_rad_s);
    Vec<N> torque;
    for (int i = 0; i < N; ++i) {
      const double omega_r = wheel_rate_rad_s(i) / bridges_.no_load_rad_s;
      torque(i) = bridges_.stall_torque_N_m *
                  held_with_drop_[static_cast<std::size_t>(i)].mean_current(omega_r, diodes_oppose_);
    }
    return torque;
  }
  /// Where they drop nothing and are enabled: all there is to a torque.
  const BridgesOf<double, N>* bridges() const noexcept {
    return command_.enable && !drops() ? &bridges_ : nullptr;
  }
  BridgeType type() const noexcept { return motor_.bridge; }
  const SupplyOf<double, N>& supply() const noexcept { return supply_; }

  void update_battery(const Vec<N>& wheel_rate_rad_s) noexcept {
    if (supply_.resistance_ohm == 0.0) return;
    if (command_.enable) {
      supply_.draw(command_.duty, wheel_rate_rad_s, &bridges_);
    } else {
      supply_.battery_V = supply_.open_V;
    }
    supplied();
  }

  /// Torque lost per rad/s of a wheel while its bridge drives. (5.12)
  double damping_N_m_s() const noexcept {
    return supply_.torque_scale * supply_.back_emf_scale * motor_.k2();
  }

 private:
  /// Diodes carry the current of a drive/coast bridge alone.
  bool drops() const noexcept { return diode_drop_V_ != 0.0 && motor_.bridge == BridgeType::kDriveCoast; }
  /// What follows from the battery's voltage.
  void supplied() noexcept {
    supply_.feed(&bridges_);
    diodes_oppose_ = 1.0 + 2.0 * diode_drop_V_ / supply_.battery_V;
  }

  MotorParameters motor_;
  Calibration calibration_;
  SupplyOf<double, N> supply_;
  double diode_drop_V_;
  double lost_duty_;
  double diodes_oppose_ = 1.0;
  MotorCommand command_{};
  BridgesOf<double, N> bridges_;
  std::array<DriveCoastDropCommand, N> held_with_drop_{};
};

}  // namespace equipoise
