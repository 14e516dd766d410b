// Watches over the loop: deadlines, guard, failing motor writes, failing log. In: loop clock, sample,
// heartbeat page, flags -> out: SafetyReason bits that forbid motors, timing for the record. One beat per
// whole tick: a loop that hangs anywhere stops beating. RT-safe; the clock read is a vDSO call.
#pragma once

#include "equipoise/actuate/safety_reasons.hpp"
#include "equipoise/runtime/heartbeat.hpp"
#include "equipoise/runtime/monotonic.hpp"
#include "equipoise/runtime/timing.hpp"
#include "equipoise/samples.hpp"

namespace equipoise::runtime {

/// What is watched beside the loop itself.
struct Watched {
  HeartbeatPage* page = nullptr;                  // without a guard: none
  std::uint32_t standing = 0;                     // known before the start, e.g. kRealtimeMissing
  const std::atomic<bool>* log_failed = nullptr;  // Telemetry's; without a log: none
  bool simulated_time = false;                    // a tick takes none, and no guard watches
};

class Supervisor {
 public:
  explicit Supervisor(const Watched& watched) : watched_(watched) {
    if (watched.page != nullptr) cut_ = watched.page->cut.load(std::memory_order_acquire);
  }

  std::uint32_t begin(std::int64_t now_ns, const RawSample& raw) noexcept {
    timing_.begin(now_ns, raw.t_ns);
    std::uint32_t reasons = watched_.standing;
    if (timing_.overrun()) reasons |= kOverrun;
    if (write_error_ != 0) reasons |= kWriteFailed;
    if (watched_.log_failed != nullptr && watched_.log_failed->load(std::memory_order_relaxed))
      reasons |= kLogFailed;  // nothing runs unrecorded
    if (watched_.page != nullptr) {
      const std::uint32_t cut = watched_.page->cut.load(std::memory_order_acquire);
      if (watched_.page->guard_is_dead(now_ns)) reasons |= kGuardDead;
      if (cut != cut_) reasons |= kOverrun;  // it stopped us: we were too late
      cut_ = cut;
    }
    return reasons;
  }

  /// `driven`: this tick's command has the bridges awake; `write_error`: what writing it returned.
  void end(bool driven, int write_error) noexcept {
    write_error_ = write_error;
    if (watched_.simulated_time) return;
    const std::int64_t now_ns = monotonic_now_ns();
    if (watched_.page != nullptr) {
      watched_.page->want_enable.store(driven ? 1 : 0, std::memory_order_relaxed);
      if (!driven) watched_.page->answered.store(cut_, std::memory_order_relaxed);
      watched_.page->loop_ns.store(now_ns, std::memory_order_release);
    }
    timing_.end(now_ns);
  }

  const LoopTiming& timing() const noexcept { return timing_; }

 private:
  LoopTiming timing_;
  Watched watched_;
  std::uint32_t cut_ = 0;
  int write_error_ = 0;
};

}  // namespace equipoise::runtime
