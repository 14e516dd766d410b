// The simulated sensors of any robot: IMU, encoders, battery ADC, attitude packets (DMP).
// In: true motion at one instant -> out: raw counts with noise, bias, range and resolution. Each effect draws
// from its own stream. Simulation only; allocates nothing after construction; same seed, same bytes.
#pragma once

#include <Eigen/Geometry>
#include <array>

#include "equipoise/plant/delay_line.hpp"
#include "equipoise/plant/noise.hpp"
#include "equipoise/plant/vibration.hpp"
#include "equipoise/plant/world.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

/// Quaternion (w, x, y, z) of Rz Ry Rx.
std::array<double, 4> quaternion_of(const Vec3& theta_rad);

/// By a rotation vector.
Mat3 turned_by(const Vec3& rotation_rad) noexcept;

struct TrueMotion : Felt {
  Vec3 theta_rad = Vec3::Zero();  // roll, pitch, continuous yaw
  double battery_V = 0.0;
};

class SimulatedSensors {
 public:
  /// Draws the constant biases from `start`, which the world has used for its initial state.
  SimulatedSensors(const Calibration& calibration, const WorldParams& world, int wheels, NoiseStream& start,
                   const Vec3& theta_rad);

  /// True when a sensor reports the past: the world then calls `feel` at every step.
  bool aged() const noexcept { return aged_; }
  void feel(const Felt& felt) noexcept { past_.add(felt); }

  /// From now on nobody reads the attitude packets, a third of the work: they come without their angles.
  void without_attitude() noexcept { attitude_read_ = false; }

  /// What the devices report; late by the world's latency, stamped with the time of asking.
  RawSample sense(const TrueMotion& m);

 private:
  TrueMotion as_felt(const TrueMotion& m) noexcept;
  RawSample sense_now(const TrueMotion& m);
  /// Of its own clock.
  double imu_period_s() const noexcept { return kTickS / (1.0 - world_.imu_repeat_share); }
  void attitude_packet(const Vec3& theta_rad, RawSample* raw);

  Calibration calibration_;
  WorldParams world_;
  std::size_t wheels_;
  NoiseStream gyro_noise_, accel_noise_, encoder_noise_, attitude_noise_;
  Vec3 gyro_bias_, accel_bias_;
  Vibration vibration_;
  bool misaligned_;
  bool aged_;
  bool encoder_noisy_;
  DelayLine past_;
  Mat3 R_misaligned_;
  Eigen::Quaterniond q_mounted_;  // as the chip believes itself to be mounted
  bool attitude_read_ = true;
  double attitude_keep_, attitude_kick_rad_, heading_kick_rad_;  // of the error, per tick
  Vec3 attitude_error_ = Vec3::Zero();
  static constexpr std::size_t kAttitudeDelay = 16;
  std::array<Vec3, kAttitudeDelay> attitude_history_{};
  std::size_t attitude_head_ = 0;
  static constexpr std::size_t kSampleDelay = 4;
  std::array<RawSample, kSampleDelay> sampled_{};
  std::size_t samples_ = 0;
  double imu_sample_ = 0.0;  // number of its last one
};

/// Sum of the pushes that act at `time_s`, N.
Vec2 push_force_W(const WorldParams& world, double time_s) noexcept;

}  // namespace equipoise
