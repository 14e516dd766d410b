// A rigid-body engine that is not ours, behind a simulated robot's own motors, gears, friction and sensors.
// In: motor command per tick; torques at the joints and forces for each step of the engine -> out: raw
// samples. Each robot's world in an engine says what its joints are. Simulation
// only.
#pragma once

#include <cmath>

#include "equipoise/no_copy.hpp"
#include "equipoise/plant/sensors.hpp"

namespace equipoise {

struct EngineMotion {
  Mat3 R_WB = Mat3::Identity();
  Vec3 omega_B_rad_s = Vec3::Zero();
  Vec3 specific_force_B_m_s2 = Vec3::Zero();  // at the IMU, a step ago: engines compute it before they move
  Vec3 joint_rate_rad_s = Vec3::Zero();
  Vec3 position_W_m = Vec3::Zero();    // of the ball's centre, or of the middle of the axle
  Vec3 velocity_W_m_s = Vec3::Zero();  // of the same point
};

class Engine : NoCopy {
 public:
  virtual ~Engine() = default;
  /// At rest on the floor.
  virtual void start(const Mat3& R_WB, EngineMotion* motion) = 0;
  /// One step with a torque at each joint, a push at the body's centre of mass, and a force on the ball or
  /// axle.
  virtual void step(const Vec3& joint_torque_N_m, const Vec2& push_W_N, const Vec2& drag_W_N,
                    EngineMotion* motion) = 0;
};

/// Motion, hand, clock and sensors of any robot in an engine.
class EngineBody {
 public:
  EngineBody(const Calibration& calibration, const WorldParams& world, int wheels, double weight_N,
             Engine& engine);

  /// Advances one tick, or two where the loop misses one; `step()` takes one step of the engine by `drive()`.
  /// The bridges take the command at the nearest step.
  template <class Motors, class Step>
  void advance(const MotorCommand& command, Motors& motors, Step&& step) {
    advance_tick(command, motors, step);
    if (loop_noise_.happens(world_.missed_tick_share)) advance_tick(command, motors, step);
  }
  /// `wheel_angle_rad`: as the encoders have it before the step.
  void drive(const Vec3& joint_torque_N_m, const Vec<kMaxMotors>& wheel_angle_rad);
  RawSample sense(const Vec<kMaxMotors>& wheel_angle_rad, double battery_V);
  void without_attitude() noexcept { sensors_.without_attitude(); }

  const EngineMotion& motion() const noexcept { return motion_; }
  /// Roll, pitch and continuous yaw.
  Vec3 theta_rad() const noexcept;
  double time_s() const noexcept { return time_s_; }

 private:
  template <class Motors, class Step>
  void advance_tick(const MotorCommand& command, Motors& motors, Step&& step) {
    if (command.enable) held_ = false;
    const auto steps = static_cast<int>(std::lround(kTickS / world_.step_s));
    const auto taken_at = static_cast<int>(std::lround(world_.actuation_steps()));
    for (int i = 0; i < steps && !held_; ++i) {
      if (i == taken_at) motors.command(command);
      step();
      time_s_ += world_.step_s;
    }
    if (held_) time_s_ += kTickS;
  }

  WorldParams world_;
  double weight_N_;
  Engine& engine_;
  NoiseStream start_noise_, loop_noise_;
  EngineMotion motion_;
  double turns_rad_ = 0.0;  // whole turns of the heading
  double yaw_rad_ = 0.0;
  SimulatedSensors sensors_;
  double time_s_ = 0.0;
  bool held_ = true;
};

}  // namespace equipoise
