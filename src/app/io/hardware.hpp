// The C hardware boundary as the loop's Io. RT-safe as far as the backend is.
#pragma once

#include "equipoise/samples.hpp"
#include "robot_io.h"

namespace equipoise::app {

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
    RawSample raw{};
    if (rio_read_sensors(&io_, &raw) != 0) raw.valid = 0;
    return raw;
  }

  int write(const MotorCommand& command) noexcept {
    if (!command.enable) return rio_motors_off(&io_);
    return rio_write_motors(&io_, &command);
  }

  int motors_off() noexcept { return rio_motors_off(&io_); }

 private:
  rio_t io_;
};

}  // namespace equipoise::app
