// The MBBR in another engine: our motors, gears, rollers, friction and sensors, its rigid bodies and
// contacts. The engine's joint is the ball against the body, body axes. In: motor command per tick -> out:
// raw samples, and the truth. Simulation only.
#pragma once

#include "equipoise/plant/engine.hpp"
#include "robots/mbbr/world.hpp"

namespace equipoise {

class MbbrEngineWorld {
 public:
  MbbrEngineWorld(const MbbrParameters& robot, const MotorParameters& motor, const Calibration& calibration,
                  const MbbrWorldParams& world, Engine& engine);

  void advance(const MotorCommand& command);
  RawSample sense() { return body_.sense(encoders(), motors_.battery_V()); }
  void without_attitude() noexcept { body_.without_attitude(); }
  MbbrEstimate truth() const noexcept;
  double time_s() const noexcept { return body_.time_s(); }

 private:
  void step();
  Vec3 body_force_B() const noexcept;
  Vec3 torque_B(const Vec3& relative_rate_B, const Vec3& others, double h) noexcept;
  Vec<kMaxMotors> encoders() const noexcept;

  MbbrParameters robot_;
  MbbrWorldParams world_;
  MbbrKinematics kinematics_;
  Vec3 mobility_;
  MbbrDrive::Motors motors_;
  MbbrDrive drive_;
  EngineBody body_;
  Vec3 seen_B_rad_ = Vec3::Zero();       // ball against body, as the wheels' nominal axes report it
  Vec3 omega_dot_B_ = Vec3::Zero();      // over the last step
  Vec3 rotor_rad_s_ = Vec3::Zero();      // where wheels may slip
  Vec3 others_B_rad_s2_ = Vec3::Zero();  // acceleration of the joint by all but our torque, a step ago
};

}  // namespace equipoise
