// Threads that stay: the same job for 0 .. n-1, again and again, thousands of times a second. In: count, job
// -> out: all done when each() returns; the first exception ends the rest and is thrown again. Each thread
// has its own share of the numbers, the same in every round, so that its cache keeps what belongs to them;
// who is done takes from the others' shares. Jobs that share nothing give the same results with any number of
// threads. One caller at a time.
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
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
    {
      const std::lock_guard lock(mutex_);
      share_out(count, job);
      ++round_;
      at_work_ = others_.size();
    }
    news_.notify_all();
    work(0);
    std::unique_lock lock(mutex_);
    idle_.wait(lock, [this] { return at_work_ == 0; });
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
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
    std::unique_lock lock(mutex_);
    for (std::uint64_t seen = 0;;) {
      news_.wait(lock, [&] { return round_ != seen || closing_; });
      if (closing_) return;
      seen = round_;
      lock.unlock();
      work(self);
      lock.lock();
      if (--at_work_ == 0) idle_.notify_one();
    }
  }

  std::vector<Share> shares_;
  std::vector<std::thread> others_;
  std::mutex mutex_;
  std::condition_variable news_, idle_;
  std::uint64_t round_ = 0;
  std::size_t at_work_ = 0;  // threads beside the caller
  bool closing_ = false;
  const std::function<void(int)>* job_ = nullptr;
  std::atomic<bool> failed_{false};
  std::exception_ptr failure_;
};

}  // namespace equipoise::app
