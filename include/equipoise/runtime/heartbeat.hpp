// The page that loop and guard share: each counts up once per tick, each watches the other's count.
// In: a descriptor, for the page has no name that others could open -> out: counters, no locks, no futex.
// When the guard has stopped the motors, `cut`, it believes the loop again once that has let go for a tick
// and says which cut it means, `answered`: between two of the guard's polls the loop may let go and drive on.
#pragma once

#include <atomic>
#include <cstdint>

#include "equipoise/no_copy.hpp"

namespace equipoise::runtime {

struct HeartbeatPage {
  static constexpr std::uint32_t kMagic = 0x45514842;  // "EQHB"
  std::atomic<std::uint32_t> magic;
  std::atomic<std::uint32_t> loop;         // counted up by the loop, once per tick
  std::atomic<std::uint32_t> guard;        // counted up by the guard, once per poll
  std::atomic<std::uint32_t> cut;          // times the guard has stopped the motors
  std::atomic<std::uint32_t> want_enable;  // 1: the loop drives; the guard keeps the bridges awake
  std::atomic<std::int64_t> cut_ns;        // monotonic; the motors were off by then, the last time
  std::atomic<std::uint32_t> answered;     // the last cut for which the loop has let go
};
static_assert(std::atomic<std::uint32_t>::is_always_lock_free &&
                  std::atomic<std::int64_t>::is_always_lock_free,
              "shared between processes");

/// The guard polls at four times the tick's rate and yields to the loop: silent for six ticks, it is dead.
inline constexpr std::int64_t kGuardSilent_ns = 30'000'000;

/// A count that has not moved for too long belongs to somebody who is dead, stopped or hanging.
class BeatWatch {
 public:
  explicit BeatWatch(std::int64_t limit_ns) : limit_ns_(limit_ns) {}

  /// True while the other side lives. Before its first beat nobody is alive.
  bool alive(std::uint32_t count, std::int64_t now_ns) noexcept {
    if (count != count_) {
      count_ = count;
      changed_ns_ = now_ns;
      seen_ = true;
    }
    return seen_ && now_ns - changed_ns_ <= limit_ns_;
  }
  std::int64_t silent_ns(std::int64_t now_ns) const noexcept { return now_ns - changed_ns_; }

 private:
  std::int64_t limit_ns_;
  std::uint32_t count_ = 0;
  std::int64_t changed_ns_ = 0;
  bool seen_ = false;
};

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
