// The eduMIP in another engine: our motors, gears, friction and sensors, its rigid bodies and tyres. The
// engine's joints are the wheels against the body, in the order of the equations. In: motor command per tick
// -> out: raw samples, and the truth. Simulation only.
#pragma once

#include "equipoise/plant/engine.hpp"
#include "robots/mip/world.hpp"

namespace equipoise {

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
