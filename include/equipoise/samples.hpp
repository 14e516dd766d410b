// What enters and leaves the tick, unit and frame per field.
// Faults are data: a clear `*_ok` flag or a NaN flows on; only actuate/safety decides what follows.
// RT-safe: plain values, no allocation.
#pragma once

#include <array>
#include <cstdint>

#include "equipoise/types.hpp"

namespace equipoise {

inline constexpr int kMaxMotors = 4;

/// One sample in device counts: the hardware boundary's sensors (drivers/robot_io.h), field by field.
struct RawSample {
  std::int64_t t_ns = 0;                            // CLOCK_MONOTONIC at the IMU's data-ready edge
  std::array<double, 3> gyro_counts{};              // sensor axes
  std::array<double, 3> accel_counts{};             // sensor axes, specific force
  std::array<double, kMaxMotors> encoder_counts{};  // unwrapped, motor order
  double battery_counts = 0.0;                      // ADC counts
  std::array<double, 4> attitude_wxyz{1, 0, 0, 0};  // R_WS of the attitude source (DMP)
  bool imu_ok = false;
  bool encoders_ok = false;
  bool battery_ok = false;
  bool attitude_ok = false;  // a new packet since the last sample
  std::uint32_t health = 0;  // bits of enum rio_health, recorded only
};

/// The same sample in SI units and body axes. `Wheels`: the robot's motor count.
template <int Wheels>
struct Measurement {
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
};

/// What a person or a script asks for.
struct Command {
  Vec2 velocity_W_m_s = Vec2::Zero();  // relative to the heading at the last heading reset
  double yaw_rate_rad_s = 0.0;
  bool arm = false;
  bool heading_reset = false;
  double age_s = 0.0;  // since somebody last asked for it
};

/// What the bridges get.
struct MotorCommand {
  std::array<double, kMaxMotors> duty{};  // -1 .. 1, motor order
  bool enable = false;                    // false: bridges asleep, motors coast
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
