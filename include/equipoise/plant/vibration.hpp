// How wheels, rollers and gears shake gyro and accelerometer. In: time, wheel angles of each tick -> out:
// what is added to both. A plateau (AR(2)) and lines that follow the wheels, in bursts: Gaussian times a
// log-normal envelope. It grows with the wheels' rate w as w / (w + half rate); at rest there is none.
// Source: real logs, docs/disturbances.md. Simulation only; allocates nothing; same seed, same bytes.
#pragma once

#include <array>

#include "equipoise/plant/noise.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

struct VibrationParams {
  Vec3 gyro_sigma_rad_s = Vec3::Zero();  // of each axis, wheels fast
  Vec3 accel_sigma_m_s2 = Vec3::Zero();
  double gyro_half_rate_rad_s = 0.4;  // of the wheels: half of it
  double accel_half_rate_rad_s = 3.0;
  double centre_hz = 22.0;           // of the plateau
  double bandwidth_hz = 33.0;        // of its poles
  double line_share = 0.0;           // of the variance
  Vec2 lines_per_turn{12.0, 144.0};  // of a wheel: rollers, gear teeth
  double excess_kurtosis = 0.0;      // 0: no bursts
  double burst_s = 0.06;             // time constant of the envelope

  bool on() const noexcept { return !gyro_sigma_rad_s.isZero(0.0) || !accel_sigma_m_s2.isZero(0.0); }
};

class Vibration {
 public:
  Vibration(const VibrationParams& p, std::uint64_t seed, std::size_t wheels);

  /// One tick: added to the gyro, rad/s, and to the specific force, m/s^2.
  struct Shaken {
    Vec3 gyro_rad_s, accel_m_s2;
  };
  Shaken update(double time_s, const Vec<kMaxMotors>& wheel_angle_rad);

 private:
  using Vec6 = Vec<6>;

  VibrationParams p_;
  std::size_t wheels_;
  NoiseStream noise_;
  Vec2 plateau_;  // of the last two values
  double kick_;   // into a plateau of variance 1
  double log_sigma_, envelope_keep_, envelope_kick_;
  Vec6 before_ = Vec6::Zero();
  Vec6 before_that_ = Vec6::Zero();
  double envelope_ = 0.0;                                          // its logarithm, in sigmas
  Mat<6, 4 * kMaxMotors> lines_ = Mat<6, 4 * kMaxMotors>::Zero();  // of sines and cosines, variance 1
  std::array<double, kMaxMotors> angle_rad_{};
  double time_s_ = -1.0;  // of the last tick; before the first: negative
};

}  // namespace equipoise
