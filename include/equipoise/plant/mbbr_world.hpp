// The MBBR's simulated world: exact rolling dynamics in RK4, three motors behind their bridges, friction,
// sensors. In: motor command per tick -> out: raw samples, and the truth. A hand holds the body until the
// motors are first enabled. Coulomb friction is a torque held over each step: the one that stops the axis, at
// most mu_c. Simulation only; allocates nothing after construction; same seed, same bytes.
#pragma once

#include "equipoise/plant/mbbr_dynamics.hpp"
#include "equipoise/plant/motors.hpp"
#include "equipoise/plant/sensors.hpp"

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
  double battery_V() const noexcept { return motors_.battery_V(); }

 private:
  /// Attitude, body rates, ball rates, ball angles (inertial), relative ball angle; 3 + 3 + 2 + 2 + 3.
  using State = Vec<13>;
  static MbbrMotion motion(const State& s) noexcept;
  State derivative(const State& s, const Vec3& friction_B, const Vec2& push_W) const noexcept;
  Vec3 motor_torque_B(const Vec3& relative_rate_B) const noexcept;
  Vec3 coulomb_torque_B(const State& s, const Vec2& push_W) const noexcept;
  Vec2 push_now() const noexcept { return push_force_W(world_, time_s_); }
  void disturb();

  MbbrParameters robot_;
  WorldParams world_;
  MbbrKinematics kinematics_;
  MbbrDynamics dynamics_;
  Vec3 mobility_;
  SimulatedMotors<Mbbr::kWheels> motors_;
  NoiseStream start_noise_, process_noise_;
  State s_;
  SimulatedSensors sensors_;
  double time_s_ = 0.0;
  bool held_ = true;
};

}  // namespace equipoise
