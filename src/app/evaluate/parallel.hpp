// The same job for 0 .. n-1 on several threads, with progress. In: what it is, count, threads, job -> out:
// all done; exceptions as in workers.hpp.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>

#include "app/cli/progress.hpp"
#include "app/sim/workers.hpp"

namespace equipoise::app {

inline void in_parallel(const char* what, std::size_t count, unsigned threads,
                        const std::function<void(std::size_t)>& job) {
  Progress progress(what);
  std::atomic<std::size_t> done{0};
  Workers workers(static_cast<unsigned>(std::min<std::size_t>(threads, std::max<std::size_t>(count, 1))));
  workers.each(static_cast<int>(count), [&](int i) {
    job(static_cast<std::size_t>(i));
    progress.at(static_cast<double>(++done) / static_cast<double>(count));
  });
}

}  // namespace equipoise::app
