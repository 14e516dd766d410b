// The C hardware boundary seen from the core: rio_sensors_t <-> RawSample, MotorCommand <-> rio_motors_t.
// RT-safe.
#pragma once

#include "equipoise/samples.hpp"
#include "robot_io.h"

namespace equipoise::app {

RawSample from_rio(const rio_sensors_t& s) noexcept;
rio_sensors_t to_rio(const RawSample& raw) noexcept;
rio_motors_t to_rio(const MotorCommand& command) noexcept;
MotorCommand from_rio(const rio_motors_t& motors) noexcept;

/// Owns a backend for the loop. `close` is motors off, then release.
class Hardware {
 public:
  explicit Hardware(rio_t io) : io_(io) {}
  ~Hardware() { rio_close(&io_); }
  Hardware(const Hardware&) = delete;
  Hardware& operator=(const Hardware&) = delete;

  int wait_tick(std::int64_t* now_ns) noexcept { return rio_wait_tick(&io_, now_ns); }

  /// A failed read is a sample with nothing valid in it.
  RawSample read() noexcept {
    rio_sensors_t s{};
    if (rio_read_sensors(&io_, &s) != 0) s.valid = 0;
    return from_rio(s);
  }

  int write(const MotorCommand& command) noexcept {
    if (!command.enable) return rio_motors_off(&io_);
    const rio_motors_t motors = to_rio(command);
    return rio_write_motors(&io_, &motors);
  }

  int motors_off() noexcept { return rio_motors_off(&io_); }

 private:
  rio_t io_;
};

}  // namespace equipoise::app
