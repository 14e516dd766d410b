// A scripted robot behind the hardware boundary, for tests: one sample per tick, and what was commanded.
// In: samples -> out: the same, then -ESHUTDOWN; every write, in order. Tests only.
#pragma once

#include <vector>

#include "app/io/hardware.hpp"

namespace equipoise::app {

class Mock {
 public:
  explicit Mock(std::vector<rio_sensors_t> script) : script_(std::move(script)) {}

  rio_t io() noexcept {
    static const rio_ops_t ops{wait_tick, read_sensors, write_motors, motors_off, close};
    return {&ops, this};
  }

  int fail_reads_with = 0;            // -errno of every read from now on
  int fail_writes_with = 0;           // and of every write
  std::vector<rio_motors_t> written;  // one per write; motors_off appends a disabled one
  bool closed = false;

 private:
  static Mock& self(void* p) noexcept { return *static_cast<Mock*>(p); }

  static int wait_tick(void* p, std::int64_t* now_ns) {
    if (self(p).next_ >= self(p).script_.size()) return -ESHUTDOWN;
    self(p).now_ = self(p).script_[self(p).next_++];
    *now_ns = self(p).now_.t_ns;
    return 0;
  }
  static int read_sensors(void* p, rio_sensors_t* out) {
    if (self(p).fail_reads_with != 0) return self(p).fail_reads_with;
    *out = self(p).now_;
    return 0;
  }
  static int write_motors(void* p, const rio_motors_t* motors) {
    if (self(p).fail_writes_with != 0) {
      motors_off(p);
      return self(p).fail_writes_with;
    }
    self(p).written.push_back(*motors);
    return 0;
  }
  static int motors_off(void* p) {
    self(p).written.push_back(rio_motors_t{});
    return 0;
  }
  static void close(void* p) {
    motors_off(p);
    self(p).closed = true;
  }

  std::vector<rio_sensors_t> script_;
  std::size_t next_ = 0;
  rio_sensors_t now_{};
};

}  // namespace equipoise::app
