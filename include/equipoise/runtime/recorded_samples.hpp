// Io of the loop that plays samples back; motor commands go nowhere. In: samples -> out: one per tick, then
// -ESHUTDOWN.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "equipoise/samples.hpp"

namespace equipoise::runtime {

class RecordedSamples {
 public:
  int wait_tick(std::int64_t* now_ns) noexcept {
    if (next_ == samples.size()) return -ESHUTDOWN;
    *now_ns = samples[next_].t_ns;
    return 0;
  }
  RawSample read() noexcept { return samples[next_++]; }
  int write(const MotorCommand& /*command*/) noexcept { return 0; }
  int motors_off() noexcept { return 0; }

  std::vector<RawSample> samples;

 private:
  std::size_t next_ = 0;
};

}  // namespace equipoise::runtime
