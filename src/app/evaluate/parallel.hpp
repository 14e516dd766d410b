// The same job for 0 .. n-1 on several threads, with progress. In: what it is, count, threads, job -> out:
// its results in order, so that they do not depend on the number of threads; exceptions as in workers.hpp.
#pragma once

#include <algorithm>
#include <atomic>
#include <vector>

#include "app/cli/progress.hpp"
#include "app/sim/workers.hpp"

namespace equipoise::app {

template <class Result, class Job>
std::vector<Result> in_parallel(const char* what, std::size_t count, unsigned threads, Job&& job) {
  Progress progress(what);
  std::vector<Result> results(count);
  std::atomic<std::size_t> done{0};
  Workers workers(static_cast<unsigned>(std::min<std::size_t>(threads, std::max<std::size_t>(count, 1))));
  workers.each(static_cast<int>(count), [&](int i) {
    results[static_cast<std::size_t>(i)] = job(static_cast<std::size_t>(i));
    progress.at(static_cast<double>(++done) / static_cast<double>(count));
  });
  return results;
}

}  // namespace equipoise::app
