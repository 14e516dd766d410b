// Lock-free queue between one producer and one consumer; wait-free for both.
// In: push(value) -> false if full, never blocks. Out: front() -> the oldest, nullptr if empty; drop() frees
// its place. RT-safe: memory is allocated at construction only.
#pragma once

#include <atomic>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace equipoise::runtime {

template <class T>
class SpscQueue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  /// Holds at least `capacity` values (rounded up to a power of two).
  explicit SpscQueue(std::size_t capacity) : slots_(round_up(capacity)), mask_(slots_.size() - 1) {}

  bool push(const T& value) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_seen_ == slots_.size()) {
      tail_seen_ = tail_.load(std::memory_order_acquire);
      if (head - tail_seen_ == slots_.size()) return false;
    }
    slots_[head & mask_] = value;
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

  /// The oldest value, where it lies until drop(); nullptr if there is none.
  const T* front() noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail == head_seen_) {
      head_seen_ = head_.load(std::memory_order_acquire);
      if (tail == head_seen_) return nullptr;
    }
    return &slots_[tail & mask_];
  }
  void drop() noexcept { tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

 private:
  static std::size_t round_up(std::size_t n) {
    std::size_t p = 2;
    while (p < n) p *= 2;
    return p;
  }

  static constexpr std::size_t kCacheLine = 64;
  std::vector<T> slots_;
  std::size_t mask_;
  alignas(kCacheLine) std::atomic<std::size_t> head_{0};
  std::size_t tail_seen_ = 0;  // producer's copy
  alignas(kCacheLine) std::atomic<std::size_t> tail_{0};
  std::size_t head_seen_ = 0;  // consumer's copy
};

}  // namespace equipoise::runtime
