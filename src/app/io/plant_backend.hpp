// A simulated world behind the hardware boundary: wait_tick advances it by one tick under the last command.
// World supplies advance(MotorCommand), sense() and time_s(). Simulation only.
#pragma once

#include "app/io/hardware.hpp"

namespace equipoise::app {

template <class World>
class PlantBackend {
 public:
  explicit PlantBackend(World& world) : world_(world) {}

  /// What the next tick is advanced under.
  const MotorCommand& command() const noexcept { return command_; }

  rio_t io() noexcept {
    static const rio_ops_t ops{wait_tick, read_sensors, write_motors, motors_off, close};
    return {&ops, this};
  }

 private:
  static PlantBackend& self(void* p) noexcept { return *static_cast<PlantBackend*>(p); }

  static int wait_tick(void* p, std::int64_t* now_ns) {
    self(p).world_.advance(self(p).command_);
    *now_ns = static_cast<std::int64_t>(self(p).world_.time_s() * 1e9);
    return 0;
  }
  static int read_sensors(void* p, rio_sensors_t* out) {
    *out = self(p).world_.sense();
    return 0;
  }
  static int write_motors(void* p, const rio_motors_t* motors) {
    self(p).command_ = *motors;
    return 0;
  }
  static int motors_off(void* p) {
    self(p).command_ = MotorCommand{};
    return 0;
  }
  static void close(void* p) { motors_off(p); }

  World& world_;
  MotorCommand command_{};
};

}  // namespace equipoise::app
