// Threads that stay: the same job for 0 .. n-1, again and again, thousands of times a second. In: count, job
// -> out: all done when each() returns; the first exception ends the rest and is thrown again. Jobs that
// share nothing give the same results with any number of threads. One caller at a time.
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
  explicit Workers(unsigned threads) {
    for (unsigned i = 1; i < threads; ++i) others_.emplace_back([this] { serve(); });
  }
  ~Workers() {
    {
      const std::lock_guard lock(mutex_);
      closing_ = true;
    }
    news_.notify_all();
    for (std::thread& other : others_) other.join();
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  void each(int count, const std::function<void(int)>& job) {
    {
      const std::lock_guard lock(mutex_);
      job_ = &job;
      next_ = 0;
      count_ = count;
      failure_ = nullptr;
      ++round_;
    }
    if (count > 1) news_.notify_all();
    work(job);
    std::unique_lock lock(mutex_);
    job_ = nullptr;  // who wakes up now is too late
    idle_.wait(lock, [this] { return working_ == 0; });
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  void work(const std::function<void(int)>& job) noexcept {
    for (int i = next_++; i < count_; i = next_++) {
      try {
        job(i);
      } catch (...) {
        const std::lock_guard lock(mutex_);
        if (!failure_) failure_ = std::current_exception();
        next_ = count_;
      }
    }
  }

  void serve() {
    std::uint64_t seen = 0;
    std::unique_lock lock(mutex_);
    for (;;) {
      news_.wait(lock, [&] { return closing_ || (job_ != nullptr && round_ != seen); });
      if (closing_) return;
      seen = round_;
      const std::function<void(int)>& job = *job_;
      ++working_;
      lock.unlock();
      work(job);
      lock.lock();
      if (--working_ == 0) idle_.notify_one();
    }
  }

  std::vector<std::thread> others_;
  std::mutex mutex_;
  std::condition_variable news_, idle_;
  const std::function<void(int)>* job_ = nullptr;
  std::atomic<int> next_{0};
  int count_ = 0;
  int working_ = 0;  // of the others
  std::uint64_t round_ = 0;
  bool closing_ = false;
  std::exception_ptr failure_;
};

}  // namespace equipoise::app
