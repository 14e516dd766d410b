// The same job for 0 .. n-1 on several threads. In: what it is, count, threads, job -> out: its results in
// order, so that they do not depend on the number of threads. The first exception ends the rest and is thrown
// again.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "app/cli/progress.hpp"

namespace equipoise::app {

/// 0: all cores.
inline unsigned threads_for(int jobs) {
  return jobs > 0 ? static_cast<unsigned>(jobs) : std::max(1U, std::thread::hardware_concurrency());
}

template <class Result, class Job>
std::vector<Result> in_parallel(const char* what, std::size_t count, unsigned threads, Job&& job) {
  Progress progress(what);
  std::vector<Result> results(count);
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  std::exception_ptr failure;
  std::mutex failing;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        results[i] = job(i);
        progress.at(static_cast<double>(++done) / static_cast<double>(count));
      } catch (...) {
        const std::lock_guard<std::mutex> lock(failing);
        if (!failure) failure = std::current_exception();
        next = count;
      }
    }
  };
  std::vector<std::thread> others;
  for (unsigned i = 1; i < threads && i < count; ++i) others.emplace_back(work);
  work();
  for (std::thread& t : others) t.join();
  if (failure) std::rethrow_exception(failure);
  return results;
}

}  // namespace equipoise::app
