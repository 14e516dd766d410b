// What enters and leaves the tick, unit and frame per field.
// Faults are data: a clear `*_ok` flag or a NaN flows on; only actuate/safety decides what follows.
// RT-safe: plain values, no allocation.
#pragma once

#include <array>
#include <cstdint>

#include "equipoise/sample.h"
#include "equipoise/types.hpp"

namespace equipoise {

inline constexpr int kMaxMotors = RIO_MAX_MOTORS;

/// One sample in device counts, straight from the hardware boundary (sample.h).
using RawSample = rio_sensors_t;
inline bool imu_ok(const RawSample& raw) noexcept { return (raw.valid & RIO_IMU) != 0; }
inline bool encoders_ok(const RawSample& raw) noexcept { return (raw.valid & RIO_ENCODERS) != 0; }
inline bool battery_ok(const RawSample& raw) noexcept { return (raw.valid & RIO_BATTERY) != 0; }
inline bool attitude_ok(const RawSample& raw) noexcept { return (raw.valid & RIO_ATTITUDE) != 0; }

/// What the bridges get.
using MotorCommand = rio_motors_t;

template <std::size_t N>
constexpr std::array<bool, N> all_true() noexcept {
  std::array<bool, N> flags{};
  for (bool& flag : flags) flag = true;
  return flags;
}

/// The same sample in SI units and body axes. `Wheels`: the robot's motor count.
template <int Wheels>
struct Measurement {
  using WheelFlags = std::array<bool, Wheels>;
  std::int64_t t_ns = 0;
  Vec3 gyro_B_rad_s = Vec3::Zero();
  Vec3 accel_B_m_s2 = Vec3::Zero();  // [T] (5.26): gravity minus acceleration; at rest z = -9.8
  Vec<Wheels> wheel_angle_rad = Vec<Wheels>::Zero();   // relative to the body
  Vec<Wheels> wheel_rate_rad_s = Vec<Wheels>::Zero();  // six-point slope, [T] (6.20)
  double battery_V = 0.0;
  Vec3 attitude_rad = Vec3::Zero();  // theta_x, theta_y, theta_z of the attitude source
  bool imu_ok = false;
  bool encoders_ok = false;
  bool battery_ok = false;
  bool attitude_ok = false;
  int ticks = 1;              // since the last sample, by the loop's clock: more than one after a stall
  bool encoder_jump = false;  // an encoder jumps too often to be believed
  bool accel_frozen = false;  // the accelerometer's counts stand still
  bool bridge_fault = false;  // a bridge complains
  std::array<bool, 3> gyro_axis_ok{true, true, true};      // beside imu_ok: an axis that is known to be dead
  std::array<bool, Wheels> wheel_ok = all_true<Wheels>();  // beside encoders_ok: a wheel that lies
};

/// What a person or a script asks for.
struct Command {
  Vec2 velocity_W_m_s = Vec2::Zero();  // relative to the heading at the last heading reset
  double yaw_rate_rad_s = 0.0;
  bool arm = false;
  bool heading_reset = false;
  double age_s = 0.0;  // since somebody last asked for it
};

/// What the loop tells the tick.
struct LoopState {
  std::int64_t now_ns = 0;    // its clock, at wake-up
  std::uint32_t inhibit = 0;  // SafetyReason bits of the runtime (guard, overruns, ...)
};

/// Robot-neutral view of an estimate, a reference or the truth, for telemetry, metrics and safety.
/// MBBR: roll, pitch, yaw; ball angles. MIP: lean, 0, yaw; mean encoder angle, 0.
struct StateView {
  Vec3 theta_rad = Vec3::Zero();
  Vec3 omega_B_rad_s = Vec3::Zero();
  Vec2 phi_rad = Vec2::Zero();
  Vec2 phi_dot_rad_s = Vec2::Zero();  // MBBR: yaw frame
  Vec2 position_W_m = Vec2::Zero();
  double normalized_innovation = 0.0;  // NIS / degrees of freedom; 0 where there is no filter
};

/// Squared errors of an estimate, summed over `axes`, for metrics. Speed: MBBR, m/s; MIP, rad/s.
struct StateErrors {
  double attitude_squared = 0.0;
  double speed_squared = 0.0;
  int axes = 1;
};

}  // namespace equipoise
