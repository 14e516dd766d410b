// The MIP's simulated world: exact dynamics in RK4, two motors behind their bridges and gears, sensors.
// In: motor command per tick -> out: raw samples, and the truth. A hand holds the body until the motors are
// first enabled, and may lift the robot later: the wheels then turn freely. Backlash: while a motor crosses
// its gear's play it turns alone, and the wheel feels nothing. Simulation only; allocates nothing after
// construction; same seed, same bytes.
#pragma once

#include <array>

#include "equipoise/plant/gear_play.hpp"
#include "equipoise/plant/motors.hpp"
#include "equipoise/plant/sensors.hpp"
#include "robots/mip/dynamics.hpp"

namespace equipoise {

/// What the two drives have beside motor and bridge.
struct MipDrivetrain {
  Vec2 motor_gain = Vec2::Ones();     // torque of each motor over nominal
  Vec2 friction_gain = Vec2::Ones();  // Coulomb friction of each gear over nominal
  GearPlayParams gear;
};

struct MipWorldParams {
  WorldParams common;
  MipDrivetrain drivetrain;
  Vec<6> process_noise_sigma = Vec<6>::Zero();  // per tick: theta, phi, psi, and their rates
  double lift_at_s = -1.0;                      // a hand lifts the robot; negative: never
};

/// The robot as it is built, where the firmware has `nominal`.
MipParameters as_built(MipParameters nominal, const ActualScales& actual) noexcept;

class MipWorld {
 public:
  MipWorld(const MipParameters& robot, const MotorParameters& motor, const Calibration& calibration,
           const MipWorldParams& world);

  /// Advances one tick with the bridges as commanded.
  void advance(const MotorCommand& command);

  /// What the devices report now.
  RawSample sense();

  MipEstimate truth() const noexcept;
  const MipParameters& robot() const noexcept { return robot_; }  // as built
  double time_s() const noexcept { return time_s_; }
  bool held() const noexcept { return held_; }
  double battery_V() const noexcept { return motors_.battery_V(); }

 private:
  /// theta, phi, psi, their rates, position in W.
  using State = Vec<8>;
  static MipMotion motion(const State& s) noexcept;
  Vec2 wheel_rates(const State& s) const noexcept;
  Vec2 gear_torque(const State& s) const noexcept;
  /// Sines and cosines of a state, computed once per evaluation.
  struct Facing {
    explicit Facing(const State& s) noexcept;
    Facing(const Facing& before, const State& s, const State& from) noexcept;  // within a step from there

    Turn tilt, heading;
  };
  Vec3 accelerations(const State& s, const Facing& facing, const Vec2& wheel_torque) const noexcept;
  State derivative(const State& s, const Facing& facing, const Vec3& accelerations) const noexcept;
  Vec2 friction_torque(const State& s, const Facing& facing, const Vec2& gear_torque) const noexcept;
  Felt felt(const Vec3& accelerations) const noexcept;
  void step(double h) noexcept;
  void cross_backlash(double step_s) noexcept;
  void disturb();
  bool lifted() const noexcept { return world_.lift_at_s >= 0.0 && time_s_ >= world_.lift_at_s; }

  MipParameters robot_;
  MipWorldParams world_;
  MipKinematics kinematics_;
  MipDynamics dynamics_;
  Mat<2, 2> mobility_;  // of the wheels' encoder rates
  SimulatedMotors<Mip::kWheels> motors_;
  NoiseStream start_noise_, process_noise_;
  State s_;
  SimulatedSensors sensors_;
  double time_s_ = 0.0;
  bool held_ = true;
  std::array<GearPlay, Mip::kWheels> gears_;
  Vec2 engaged_ = Vec2::Ones();  // 1: teeth in contact
};

}  // namespace equipoise
