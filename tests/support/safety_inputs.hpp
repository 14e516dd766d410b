// What Safety gets from a robot that is well, and parameters that check all of it.
#pragma once

#include "equipoise/actuate/safety.hpp"
#include "support/assign.hpp"

namespace equipoise {

inline SafetyInputs well() {
  SafetyInputs in;
  in.imu_ok = in.encoders_ok = in.battery_ok = in.attitude_ok = in.all_finite = in.arm_requested = true;
  in.battery_V = 8.0;
  in.accel_m_s2 = kGravity_m_s2;
  return in;
}

inline MotorCommand half() {
  MotorCommand command{};
  assign(command.duty, {0.5, 0.5, 0.5, 0.0});
  return command;
}

inline SafetyParams params() {
  SafetyParams p;
  p.needs_attitude = true;
  return p;
}

}  // namespace equipoise
