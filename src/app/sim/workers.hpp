// Threads that stay: the same job for 0 .. n-1, again and again, thousands of times a second. In: count, job
// -> out: all done when each() returns; the first exception ends the rest and is thrown again. Each thread
// has its own share of the numbers, the same in every round, so that its cache keeps what belongs to them;
// who is done takes from the others' shares. Jobs that share nothing give the same results with any number of
// threads. One caller at a time, who may leave a round to the others meanwhile: start(), finish().
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace equipoise::app {

/// 0: all cores.
inline unsigned threads_for(int jobs) {
  return jobs > 0 ? static_cast<unsigned>(jobs) : std::max(1U, std::thread::hardware_concurrency());
}

class Workers {
 public:
  /// `threads`: with the caller's, which works, too.
  explicit Workers(unsigned threads) : shares_(std::max(threads, 1U)) {
    for (std::size_t i = 1; i < shares_.size(); ++i) others_.emplace_back([this, i] { serve(i); });
  }
  ~Workers() {
    {
      const std::lock_guard lock(mutex_);
      closing_ = true;
    }
    news_.notify_all();
    for (std::thread& other : others_) other.join();
  }

  int threads() const noexcept { return static_cast<int>(shares_.size()); }

  void each(int count, const std::function<void(int)>& job) {
    finish();
    share_out(count, job);
    if (count > 1) open();
    complete();
  }

  /// The others begin; the caller goes about its own business, and `job` lives on, until finish(), which any
  /// other call is, too.
  void start(int count, const std::function<void(int)>& job) {
    finish();
    share_out(count, job);
    started_ = true;
    open();
  }
  /// What is left of what was started.
  void finish() {
    if (std::exchange(started_, false)) complete();
  }

 private:
  using Clock = std::chrono::steady_clock;

  /// Of one thread; on a cache line of its own.
  struct alignas(64) Share {
    std::atomic<int> next{0};
    int end = 0;
  };

  void share_out(int count, const std::function<void(int)>& job) {
    const auto threads = static_cast<std::int64_t>(shares_.size());
    for (std::int64_t i = 0; i < threads; ++i) {
      Share& share = shares_[static_cast<std::size_t>(i)];
      share.next = static_cast<int>(count * i / threads);
      share.end = static_cast<int>(count * (i + 1) / threads);
    }
    job_ = &job;
    failure_ = nullptr;
    failed_ = false;
  }

  void complete() {
    work(0);
    close();
    if (failure_) std::rethrow_exception(failure_);
  }

  // What state_ counts: rounds, threads at work beside the caller, and whether more may join them.
  static constexpr std::uint64_t kOpen = 1;
  static constexpr std::uint64_t kOneAtWork = 2;
  static constexpr std::uint64_t kOneRound = 1U << 16U;

  /// For so long a thread stays awake: to be woken takes as long as many a job, and a caller that steps
  /// robots comes back soon.
  static constexpr std::chrono::microseconds kAwake{200};

  static bool soon(const std::function<bool()>& condition) {
    if (condition()) return true;
    for (const auto end = Clock::now() + kAwake; Clock::now() < end;) {
      std::this_thread::yield();
      if (condition()) return true;
    }
    return false;
  }

  void open() {
    state_ += kOneRound + kOpen;
    if (asleep_ == 0) return;
    const std::lock_guard lock(mutex_);
    news_.notify_all();
  }

  /// Who comes now is too late; who is at work is waited for.
  void close() {
    state_ &= ~kOpen;
    const auto idle = [this] { return state_ % kOneRound == 0; };
    if (soon(idle)) return;
    std::unique_lock lock(mutex_);
    caller_sleeps_ = true;
    idle_.wait(lock, idle);
    caller_sleeps_ = false;
  }

  /// True once per round, while it is open.
  bool join(std::uint64_t* seen) {
    std::uint64_t state = state_;
    while ((state & kOpen) != 0 && state / kOneRound != *seen) {
      if (!state_.compare_exchange_weak(state, state + kOneAtWork)) continue;
      *seen = state / kOneRound;
      return true;
    }
    return false;
  }

  void leave() {
    state_ -= kOneAtWork;
    if (!caller_sleeps_) return;
    const std::lock_guard lock(mutex_);
    idle_.notify_one();
  }

  void work(std::size_t self) noexcept {
    for (std::size_t k = 0; k < shares_.size(); ++k) {
      Share& share = shares_[(self + k) % shares_.size()];
      for (int i = share.next++; i < share.end && !failed_; i = share.next++) {
        try {
          (*job_)(i);
        } catch (...) {
          const std::lock_guard lock(mutex_);
          if (!failure_) failure_ = std::current_exception();
          failed_ = true;
        }
      }
    }
  }

  void serve(std::size_t self) {
    std::uint64_t seen = 0;
    for (;;) {
      bool joined = false;
      const auto called = [&] { return (joined = join(&seen)) || closing_; };
      if (!soon(called)) {
        std::unique_lock lock(mutex_);
        ++asleep_;
        news_.wait(lock, called);
        --asleep_;
      }
      if (!joined) return;
      work(self);
      leave();
    }
  }

  std::vector<Share> shares_;
  std::vector<std::thread> others_;
  std::atomic<std::uint64_t> state_{0};
  const std::function<void(int)>* job_ = nullptr;
  bool started_ = false;  // and not finished
  std::atomic<bool> failed_{false};
  std::exception_ptr failure_;
  std::mutex mutex_;
  std::condition_variable news_, idle_;
  std::atomic<int> asleep_{0};
  std::atomic<bool> caller_sleeps_{false};
  std::atomic<bool> closing_{false};
};

}  // namespace equipoise::app
