// A scripted robot behind the hardware boundary, for tests: one sample per tick, and what was commanded.
// In: samples -> out: the same, then -ESHUTDOWN; every write, in order. Tests only.
#pragma once

#include <vector>

#include "app/io/hardware.hpp"

namespace equipoise::app {

class Mock : public Backend {
 public:
  explicit Mock(std::vector<rio_sensors_t> script) : script_(std::move(script)) {}

  int fail_reads_with = 0;            // -errno of every read from now on
  int fail_writes_with = 0;           // and of every write
  std::vector<rio_motors_t> written;  // one per write; motors_off appends a disabled one
  bool closed = false;

 private:
  int wait_tick(std::int64_t* now_ns) override {
    if (next_ >= script_.size()) return -ESHUTDOWN;
    now_ = script_[next_++];
    *now_ns = now_.t_ns;
    return 0;
  }
  int read_sensors(rio_sensors_t* out) override {
    if (fail_reads_with == 0) *out = now_;
    return fail_reads_with;
  }
  int write_motors(const rio_motors_t& motors) override {
    written.push_back(fail_writes_with == 0 ? motors : rio_motors_t{});
    return fail_writes_with;
  }
  int motors_off() override {
    written.push_back(rio_motors_t{});
    return 0;
  }
  void close() override {
    motors_off();
    closed = true;
  }

  std::vector<rio_sensors_t> script_;
  std::size_t next_ = 0;
  rio_sensors_t now_{};
};

}  // namespace equipoise::app
