// The MBBR's simulated world: exact rolling dynamics in RK4, three motors behind their bridges, friction,
// sensors. In: motor command per tick -> out: raw samples, and the truth. A hand holds the body until the
// motors are first enabled. Coulomb friction is a torque held over each step: the one that stops the axis, at
// most mu_c. Simulation only; allocates nothing after construction; same seed, same bytes.
#pragma once

#include <array>

#include "equipoise/plant/mbbr_drive.hpp"
#include "equipoise/plant/mbbr_dynamics.hpp"
#include "equipoise/plant/noise.hpp"
#include "equipoise/plant/world.hpp"

namespace equipoise {

class MbbrWorld {
 public:
  MbbrWorld(const MbbrParameters& robot, const MotorParameters& motor, const Calibration& calibration,
            const WorldParams& world);

  /// Advances one tick with the bridges as commanded.
  void advance(const MotorCommand& command);

  /// What the devices report now.
  RawSample sense();

  MbbrEstimate truth() const noexcept;
  double time_s() const noexcept { return time_s_; }
  bool held() const noexcept { return held_; }
  double battery_V() const noexcept { return battery_V_; }

 private:
  /// Attitude, body rates, ball rates, ball angles (inertial), relative ball angle; 3 + 3 + 2 + 2 + 3.
  using State = Vec<13>;
  static MbbrMotion motion(const State& s) noexcept;
  State derivative(const State& s, const Vec3& friction_B, const Vec2& push_W) const noexcept;
  Vec3 motor_torque_B(const Vec3& relative_rate_B) const noexcept;
  Vec2 slope_pull_star(double theta_z) const noexcept;
  Vec3 coulomb_torque_B(const State& s, const Vec2& push_W) const noexcept;
  Vec2 push_now() const noexcept;
  void disturb();
  void update_battery() noexcept;
  Vec3 signed_duty() const noexcept;
  double viscous_N_m_s() const noexcept;
  void sense_attitude();
  RawSample sense_now();

  MbbrParameters robot_;
  MotorParameters motor_;
  Calibration calibration_;
  WorldParams world_;
  MbbrKinematics kinematics_;
  MbbrDynamics dynamics_;
  Vec3 mobility_;
  MbbrDrive drive_;  // used when the world is disturbed
  Mat3 R_imu_;       // misalignment
  NoiseStream start_noise_, process_noise_, gyro_noise_, accel_noise_, encoder_noise_, attitude_noise_;

  State s_ = State::Zero();
  double time_s_ = 0.0;
  bool held_ = true;
  MotorCommand command_;
  static constexpr std::size_t kSensorDelay = 4;
  std::array<RawSample, kSensorDelay> sensed_{};
  std::size_t sensed_count_ = 0;
  double battery_V_;
  Vec3 gyro_bias_, accel_bias_;
  Vec3 attitude_error_ = Vec3::Zero();
  static constexpr std::size_t kAttitudeDelay = 16;
  std::array<Vec3, kAttitudeDelay> attitude_history_{};
  std::size_t attitude_head_ = 0;
};

}  // namespace equipoise
