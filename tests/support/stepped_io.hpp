// A hardware boundary for the loop that can be driven one tick at a time and whose samples a test may spoil.
// In: backend, interfere(RawSample&) -> out: an Io; after each allowed tick the loop returns, and the motors
// keep their last command until the next. Tests only.
#pragma once

#include <cerrno>

#include "app/io/hardware.hpp"

namespace equipoise {

template <class Interfere>
class SteppedIo {
 public:
  SteppedIo(app::Hardware& hardware, std::int64_t ticks, Interfere& interfere)
      : hardware_(hardware), left_(ticks), interfere_(interfere) {}

  int wait_tick(std::int64_t* now_ns) noexcept {
    return left_-- > 0 ? hardware_.wait_tick(now_ns) : -ESHUTDOWN;
  }
  RawSample read() noexcept {
    RawSample raw = hardware_.read();
    interfere_(raw);
    return raw;
  }
  int write(const MotorCommand& command) noexcept { return hardware_.write(command); }
  int motors_off() noexcept { return 0; }  // a pause, not an end

 private:
  app::Hardware& hardware_;
  std::int64_t left_;
  Interfere& interfere_;
};

}  // namespace equipoise
