// A simulated world behind the hardware boundary: wait_tick advances it by one tick under the last command.
// Simulation only.
#pragma once

#include "app/io/hardware.hpp"
#include "equipoise/plant/ticked_world.hpp"

namespace equipoise::app {

class PlantBackend : public Backend {
 public:
  explicit PlantBackend(SimulatedDevices& world) : world_(world) {}

 private:
  int wait_tick(std::int64_t* now_ns) override {
    world_.advance(command_);
    *now_ns = static_cast<std::int64_t>(world_.time_s() * 1e9);
    return 0;
  }
  int read_sensors(rio_sensors_t* out) override {
    *out = world_.sense();
    return 0;
  }
  int write_motors(const rio_motors_t& motors) override {
    command_ = motors;
    return 0;
  }
  int motors_off() override { return write_motors({}); }
  void close() override { motors_off(); }

  SimulatedDevices& world_;
  MotorCommand command_{};
};

}  // namespace equipoise::app
