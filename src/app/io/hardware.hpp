// The C hardware boundary from both sides: the loop's Io, and a backend that is a class. RT-safe as far as
// the backend is.
#pragma once

#include "equipoise/no_copy.hpp"
#include "equipoise/samples.hpp"
#include "robot_io.h"

namespace equipoise::app {

/// What stands behind a rio_t, function by function (robot_io.h).
class Backend : NoCopy {
 public:
  virtual ~Backend() = default;

  rio_t io() noexcept {
    static const rio_ops_t ops{[](void* p, std::int64_t* now_ns) { return self(p).wait_tick(now_ns); },
                               [](void* p, rio_sensors_t* out) { return self(p).read_sensors(out); },
                               [](void* p, const rio_motors_t* m) { return self(p).write_motors(*m); },
                               [](void* p) { return self(p).motors_off(); },
                               [](void* p) { self(p).close(); }};
    return {&ops, this};
  }

 private:
  static Backend& self(void* p) noexcept { return *static_cast<Backend*>(p); }
  virtual int wait_tick(std::int64_t* now_ns) = 0;
  virtual int read_sensors(rio_sensors_t* out) = 0;
  virtual int write_motors(const rio_motors_t& motors) = 0;
  virtual int motors_off() = 0;
  virtual void close() = 0;
};

/// Owns a backend for the loop. `close` is motors off, then release.
class Hardware : NoCopy {
 public:
  explicit Hardware(rio_t io) : io_(io) {}
  ~Hardware() { rio_close(&io_); }

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
