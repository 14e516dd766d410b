// The MIP's simulated world: exact dynamics in RK4, two motors behind their bridges and gears, sensors.
// In: motor command per tick -> out: raw samples, and the truth. A hand holds the body until the motors are
// first enabled, and may lift the robot later: the wheels then turn freely. Backlash: while a motor crosses
// its gear's play it turns alone, and the wheel feels nothing. Simulation only; allocates nothing after
// construction; same seed, same bytes.
#pragma once

#include <array>

#include "equipoise/plant/sensors.hpp"
#include "robots/mip/rolling.hpp"

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

class MipWorld {
 public:
  using Rolling = MipRollingOf<double>;

  MipWorld(const MipParameters& robot, const MotorParameters& motor, const Calibration& calibration,
           const MipWorldParams& world);

  /// Advances one tick with the bridges as commanded.
  void advance(const MotorCommand& command);

  /// The same tick in two halves, where nothing is on that MipRollingOf leaves out: what the steps depend on,
  /// if so; and their end. Between them roll() or roll_together().
  bool begin_rolling(const MotorCommand& command, Rolling* robot) noexcept;
  void end_rolling(const Rolling& robot) noexcept;
  BridgeType bridge() const noexcept { return motors_.type(); }
  int steps_per_tick() const noexcept;
  double step_s() const noexcept { return world_.common.step_s; }

  /// What the devices report now.
  RawSample sense();
  void without_attitude() noexcept { sensors_.without_attitude(); }

  MipEstimate truth() const noexcept;
  const MipParameters& robot() const noexcept { return robot_; }  // as built
  double time_s() const noexcept { return time_s_; }
  bool held() const noexcept { return held_; }
  double battery_V() const noexcept { return motors_.battery_V(); }

 private:
  using State = MipStateOf<double>;
  using Facing = MipFacingOf<double>;
  /// With what pushes and pulls the robot, or lifts it.
  struct Body {
    const MipWorld& world;

    Vec3 accelerations(const State& s, const Facing& facing, const Vec2& wheel_torque) const noexcept {
      return world.accelerations(s, facing, wheel_torque);
    }
    double speed(const State& s) const noexcept {
      return world.lifted() ? 0.0 : -world.robot_.r * (s(mip_at::kPhiDot) + s(mip_at::kThetaDot));
    }
  };
  Eigen::Map<const State> s() const noexcept { return Eigen::Map<const State>(now_.state); }
  Vec3 accelerations(const State& s, const Facing& facing, const Vec2& wheel_torque) const noexcept;
  Vec2 friction_limit(const Vec2& wheel_rates) const noexcept;
  void feel_ground(double h) noexcept;
  double weight_kg() const noexcept { return robot_.m_b + 2.0 * robot_.m_w; }
  Felt felt(const Vec3& accelerations) const noexcept;
  void step(double h) noexcept;
  void advance_tick(const MotorCommand& command);
  void disturb();
  void end_tick() noexcept;
  bool lifted() const noexcept { return world_.lift_at_s >= 0.0 && time_s_ >= world_.lift_at_s; }

  MipParameters robot_;
  MipWorldParams world_;
  MipKinematics kinematics_;
  MipDynamics dynamics_;
  SimulatedMotors<Mip::kWheels> motors_;
  std::array<Ground, Mip::kWheels> ground_;  // at +x and at -x of the axle
  Vec2 ground_N_ = Vec2::Zero();  // forward force of both over this step, and of the first less the other
  NoiseStream start_noise_, process_noise_, loop_noise_;
  MipRollingOf<double> now_;
  SimulatedSensors sensors_;
  bool uneven_;
  bool plain_;  // as MipRollingOf has it
  double time_s_ = 0.0;
  bool held_ = true;
};

}  // namespace equipoise
