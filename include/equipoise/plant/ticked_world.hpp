// A simulated robot behind the hardware boundary, and what every robot's own world does alike in a tick. In:
// motor command per tick -> out: raw samples. A hand holds the robot until its motors are first enabled.
// Simulation only.
#pragma once

#include "equipoise/plant/motors.hpp"
#include "equipoise/plant/sensors.hpp"

namespace equipoise {

class SimulatedDevices {
 public:
  virtual ~SimulatedDevices() = default;
  /// One tick with the bridges as commanded.
  virtual void advance(const MotorCommand& command) = 0;
  /// What the devices report now.
  virtual RawSample sense() = 0;
  virtual double time_s() const noexcept = 0;
};

template <int kWheels>
class TickedWorld : public SimulatedDevices {
 public:
  void advance(const MotorCommand& command) override {
    advance_tick(command);
    if (loop_noise_.happens(common_.missed_tick_share)) advance_tick(command);
  }
  double time_s() const noexcept override { return time_s_; }

  bool held() const noexcept { return held_; }
  double battery_V() const noexcept { return motors_.battery_V(); }

 protected:
  TickedWorld(const MotorParameters& motor, const Calibration& calibration, const WorldParams& world)
      : common_(world),
        motors_(motor, calibration, world),
        start_noise_(world.seed, kStartNoise),
        process_noise_(world.seed, kProcessNoise),
        loop_noise_(world.seed, kLoop) {}

  /// Bodies, gears and friction.
  virtual void step(double h) noexcept = 0;
  virtual void end_tick() noexcept = 0;

  WorldParams common_;
  SimulatedMotors<kWheels> motors_;
  NoiseStream start_noise_, process_noise_, loop_noise_;
  double time_s_ = 0.0;
  bool held_ = true;

 private:
  void advance_tick(const MotorCommand& command) {
    if (command.enable) held_ = false;
    const int steps = static_cast<int>(std::lround(kTickS / common_.step_s));
    const double taken_at = common_.actuation_steps();
    for (int i = 0; i < steps && !held_; ++i) {
      const double part = taken_at - i;
      if (part > 0.0 && part < 1.0) {  // the PWM takes the duty within this step
        step(part * common_.step_s);
        motors_.command(command);
        step((1.0 - part) * common_.step_s);
      } else {
        if (part == 0.0) motors_.command(command);
        step(common_.step_s);
      }
    }
    if (held_) time_s_ += kTickS;
    end_tick();
  }
};

}  // namespace equipoise
