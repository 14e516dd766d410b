// Watches over the loop on the robot: deadlines, guard, failing motor writes. In: loop clock, sample,
// heartbeat page -> out: SafetyReason bits that forbid motors, timing for the record. One beat per whole
// tick: a loop that hangs anywhere stops beating. RT-safe; the clock read is a vDSO call.
#pragma once

#include "equipoise/actuate/safety_reasons.hpp"
#include "equipoise/runtime/heartbeat.hpp"
#include "equipoise/runtime/monotonic.hpp"
#include "equipoise/runtime/timing.hpp"
#include "equipoise/samples.hpp"

namespace equipoise::runtime {

class Supervisor {
 public:
  /// `page`: nullptr without a guard. `standing`: reasons known before the start, e.g. kRealtimeMissing.
  Supervisor(const OverrunPolicy& policy, HeartbeatPage* page, std::uint32_t standing)
      : timing_(policy), page_(page), standing_(standing), guard_(kGuardSilent_ns) {
    if (page_ != nullptr) cut_ = page_->cut.load(std::memory_order_acquire);
  }

  std::uint32_t begin(std::int64_t now_ns, const RawSample& raw) noexcept {
    timing_.begin(now_ns, raw.t_ns);
    std::uint32_t reasons = standing_;
    if (timing_.overrun()) reasons |= kOverrun;
    if (write_error_ != 0) reasons |= kWriteFailed;
    if (page_ != nullptr) {
      const std::uint32_t cut = page_->cut.load(std::memory_order_acquire);
      if (!guard_.alive(page_->guard.load(std::memory_order_acquire), now_ns)) reasons |= kGuardDead;
      if (cut != cut_) reasons |= kOverrun;  // it stopped us: we were too late
      cut_ = cut;
    }
    return reasons;
  }

  /// `driven`: this tick's command has the bridges awake; `write_error`: what writing it returned.
  void end(bool driven, int write_error) noexcept {
    write_error_ = write_error;
    if (page_ != nullptr) {
      page_->want_enable.store(driven ? 1 : 0, std::memory_order_relaxed);
      page_->loop.fetch_add(1, std::memory_order_release);
    }
    timing_.end(monotonic_now_ns());
  }

  const LoopTiming& timing() const noexcept { return timing_; }

 private:
  LoopTiming timing_;
  HeartbeatPage* page_;
  std::uint32_t standing_;
  std::uint32_t cut_ = 0;
  BeatWatch guard_;
  int write_error_ = 0;
};

}  // namespace equipoise::runtime
