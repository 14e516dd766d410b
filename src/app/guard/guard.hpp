// The guard: stops the bridges when the loop's heartbeat stops. In: heartbeat page, bridges -> out: bridges
// asleep and every PWM at zero a quarter of a tick after silent_ticks without a beat, whatever
// happened to the loop (SIGKILL, SIGSTOP, hang). Bridges wake only while the loop beats and asks for them;
// once they were cut, a loop that comes back must have let go first.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "cutoff.h"
#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/heartbeat.hpp"

namespace equipoise::app {

/// What the guard switches.
class Bridges : NoCopy {
 public:
  virtual ~Bridges() = default;
  virtual int enable() noexcept = 0;  // 0 or -errno
  virtual int off() noexcept = 0;     // tries everything; the first error
};

/// The board, through the C drivers.
class BoardBridges final : public Bridges {
 public:
  explicit BoardBridges(const bbb_config_t& config);  // throws std::runtime_error naming the device
  ~BoardBridges() override { cutoff_close(&cutoff_); }
  int enable() noexcept override { return cutoff_enable(&cutoff_); }
  int off() noexcept override { return cutoff_off(&cutoff_); }

 private:
  cutoff_t cutoff_{};
};

/// Kept descriptors of sysfs attributes: one write each.
class FileBridges final : public Bridges {
 public:
  FileBridges(const std::string& enable, const std::vector<std::string>& pwm);
  ~FileBridges() override;
  int enable() noexcept override;
  int off() noexcept override;

 private:
  int enable_fd_ = -1;
  std::vector<int> pwm_fds_;
};

struct GuardOptions {
  std::int64_t period_ns = 5'000'000;
  int silent_ticks = 2;  // and a quarter, by which a tick may be late: off before the third is over
  std::int64_t watchdog_ns = 200'000'000;
};

struct GuardEnd {
  int error = 0;
  std::int64_t cuts = 0;
};

GuardEnd guard_loop(const GuardOptions& options, Bridges& bridges, runtime::HeartbeatPage& page,
                    const std::atomic<bool>& stop);

}  // namespace equipoise::app
