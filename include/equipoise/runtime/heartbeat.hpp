// The page that loop and guard share: each says when it last lived, each watches the other.
// In: a descriptor, for the page has no name that others could open -> out: atomics, no locks, no futex.
// When the guard has stopped the motors, `cut`, it believes the loop again once that has let go for a tick
// and says which cut it means, `answered`: between two of the guard's polls the loop may let go and drive on.
#pragma once

#include <atomic>
#include <cstdint>

#include "equipoise/no_copy.hpp"

namespace equipoise::runtime {

struct HeartbeatPage {
  static constexpr std::uint32_t kMagic = 0x45514842;  // "EQHB"
  static constexpr std::int64_t kGuardSilent_ns = 30'000'000;
  std::atomic<std::uint32_t> magic;
  std::atomic<std::int64_t> loop_ns;       // monotonic: the loop's last beat, one per whole tick; 0: none yet
  std::atomic<std::int64_t> guard_ns;      // and when the guard last looked
  std::atomic<std::uint32_t> cut;          // times the guard has stopped the motors
  std::atomic<std::uint32_t> want_enable;  // 1: the loop drives; the guard keeps the bridges awake
  std::atomic<std::int64_t> cut_ns;        // monotonic; the motors were off by then, the last time
  std::atomic<std::uint32_t> answered;     // the last cut for which the loop has let go

  /// The guard looks at every second tick at least: silent for six, it is dead.
  bool guard_is_dead(std::int64_t now_ns) const noexcept {
    return now_ns - guard_ns.load(std::memory_order_acquire) > kGuardSilent_ns;
  }
};
static_assert(std::atomic<std::uint32_t>::is_always_lock_free &&
                  std::atomic<std::int64_t>::is_always_lock_free,
              "shared between processes");

/// Maps the page; throws std::runtime_error saying what is wrong with it.
class SharedHeartbeat : NoCopy {
 public:
  /// A new one in anonymous memory: whoever can write there can keep the motors on.
  SharedHeartbeat();
  /// Another process's, which hands over the descriptor: it must be such a page, sealed, and of our user.
  explicit SharedHeartbeat(int fd);
  ~SharedHeartbeat();

  HeartbeatPage& page() noexcept { return *page_; }
  int fd() const noexcept { return fd_; }  // closed with this, and in programs started

 private:
  void map();

  int fd_;
  HeartbeatPage* page_ = nullptr;
};

}  // namespace equipoise::runtime
