// The MIP's simulated world: exact dynamics in RK4, two motors behind their bridges and gears, sensors.
// In: motor command per tick -> out: raw samples, and the truth. A hand holds the body until the motors are
// first enabled, and may lift the robot later: the wheels then turn freely. Backlash: while a motor crosses
// its gear's play it turns alone, and the wheel feels nothing. Simulation only; allocates nothing after
// construction; same seed, same bytes.
#pragma once

#include <array>

#include "equipoise/plant/engine.hpp"
#include "equipoise/plant/gear_play.hpp"
#include "equipoise/plant/ticked_world.hpp"
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

/// Of the wheels' encoder rates per torque at the wheels, upright at rest.
Mat<2, 2> wheel_mobility(const MipParameters& robot) noexcept;

class MipWorld : public TickedWorld<Mip::kWheels> {
 public:
  MipWorld(const MipParameters& robot, const MotorParameters& motor, const Calibration& calibration,
           const MipWorldParams& world);

  RawSample sense() override;
  void without_attitude() noexcept { sensors_.without_attitude(); }

  MipEstimate truth() const noexcept;
  const MipParameters& robot() const noexcept { return robot_; }  // as built

 private:
  using State = Vec<8>;  // theta, phi, psi, their rates, position in W
  /// Sines and cosines of a state, computed once per evaluation.
  struct Facing {
    Turn tilt, heading;
  };
  static Facing facing(const State& s) noexcept;
  Vec2 wheel_rates(const State& s) const noexcept;
  double speed(const State& s) const noexcept;  // of the axle along the yaw frame's y axis, m/s
  Vec2 gear_torque(const Vec2& wheel_rates) const noexcept;
  Vec2 friction_torque(const Facing& facing, const Vec2& gear_torque) const noexcept;
  Vec3 accelerations(const State& s, const Facing& facing, const Vec2& wheel_torque) const noexcept;
  State derivative(const State& s, const Facing& facing, const Vec3& accelerations) const noexcept;
  void feel_ground(double h) noexcept;
  double weight_kg() const noexcept { return robot_.m_b + 2.0 * robot_.m_w; }
  Felt felt(const Vec3& accelerations) const noexcept;
  void step(double h) noexcept override;
  void disturb();
  void end_tick() noexcept override;
  bool lifted() const noexcept { return world_.lift_at_s >= 0.0 && time_s_ >= world_.lift_at_s; }

  MipParameters robot_;
  MipWorldParams world_;
  MipKinematics kinematics_;
  MipDynamics dynamics_;
  std::array<Ground, Mip::kWheels> ground_;  // at +x and at -x of the axle
  Vec2 ground_N_ = Vec2::Zero();  // forward force of both over this step, and of the first less the other
  Mat<2, 2> mobility_;
  State s_;
  std::array<GearPlay, Mip::kWheels> gears_;
  Vec2 engaged_ = Vec2::Ones();  // 1: teeth in contact
  SimulatedSensors sensors_;
  bool uneven_;
};

/// In another engine: our motors, gears, friction and sensors, its rigid bodies and tyres. The engine's
/// joints are the wheels against the body, in the order of the equations.
class MipEngineWorld {
 public:
  MipEngineWorld(const MipParameters& robot, const MotorParameters& motor, const Calibration& calibration,
                 const MipWorldParams& world, Engine& engine);

  void advance(const MotorCommand& command);
  RawSample sense() { return body_.sense(encoders(), motors_.battery_V()); }
  void without_attitude() noexcept { body_.without_attitude(); }
  MipEstimate truth() const noexcept;
  double time_s() const noexcept { return body_.time_s(); }

 private:
  void step();
  Vec2 wheel_rates() const noexcept { return body_.motion().joint_rate_rad_s.head<2>(); }
  Vec<kMaxMotors> encoders() const noexcept;

  MipParameters robot_;
  MipWorldParams world_;
  MipKinematics kinematics_;
  Mat<2, 2> mobility_;
  SimulatedMotors<Mip::kWheels> motors_;
  std::array<GearPlay, Mip::kWheels> gears_;
  EngineBody body_;
  Vec2 wheel_angle_rad_ = Vec2::Zero();
  Vec2 others_rad_s2_ = Vec2::Zero();  // acceleration of the wheels by all but our torque, a step ago
};

}  // namespace equipoise
