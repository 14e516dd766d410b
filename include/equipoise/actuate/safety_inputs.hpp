// What safety looks at, gathered from the tick's values. In: measurement, estimate, encoder check, command ->
// out: SafetyInputs; the pipeline adds what only it knows. Stateless, RT-safe.
#pragma once

#include <cmath>

#include "equipoise/actuate/encoder_check.hpp"
#include "equipoise/actuate/safety.hpp"

namespace equipoise {

inline bool finite(const Command& c) noexcept {
  return c.velocity_W_m_s.allFinite() && std::isfinite(c.yaw_rate_rad_s) && std::isfinite(c.age_s);
}

inline bool finite(const StateView& s) noexcept {
  return s.theta_rad.allFinite() && s.omega_B_rad_s.allFinite() && s.phi_rad.allFinite() &&
         s.phi_dot_rad_s.allFinite();
}

template <int Wheels>
SafetyInputs safety_inputs(const Measurement<Wheels>& z, const StateView& x_hat,
                           const EncoderCheck<Wheels>& check, const Command& asked) noexcept {
  SafetyInputs in;
  in.state = x_hat;
  in.imu_ok = z.imu_ok;
  in.ticks = z.ticks;
  in.encoders_ok = z.encoders_ok;
  in.encoder_jump = z.encoder_jump;
  in.battery_ok = z.battery_ok;
  in.attitude_ok = z.attitude_ok;
  in.battery_V = z.battery_V;
  in.accel_m_s2 = z.accel_B_m_s2.norm();
  for (int i = 0; i < Wheels; ++i) in.wheel_rate_rad_s[static_cast<std::size_t>(i)] = z.wheel_rate_rad_s(i);
  in.bridge_fault = z.bridge_fault;
  in.command_age_s = asked.age_s;
  in.arm_requested = asked.arm;
  in.encoders_in_check = check.running();
  in.encoders_stuck = check.faults().stuck;
  in.encoders_reversed = check.faults().reversed;
  in.all_finite = finite(asked) && finite(x_hat);
  return in;
}

}  // namespace equipoise
