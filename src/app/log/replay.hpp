// A log's samples, commands and inhibit bits through the pipeline again, and what differs. In: a log -> out:
// the first difference from what it holds, bit for bit; with `other`, the errors of another estimator beside
// it. InputError when the log holds no whole tick or its choices are unknown.
#pragma once

#include <cstdint>
#include <string>

#include "app/cli/json.hpp"
#include "app/log/run_log.hpp"
#include "app/run/verdict.hpp"

namespace equipoise::app {

/// The first field and tick that differ.
struct Difference {
  bool found = false;
  std::int64_t tick = 0;
  std::string field;
  double logged = 0.0;
  double replayed = 0.0;
};

/// Root mean square errors of an estimate against the log's truth, after the first five seconds as in sim.
struct ReplayErrors {
  double attitude = 0.0;
  double rate = 0.0;
  double position = 0.0;
  std::int64_t ticks = 0;

  void add(const runtime::StateRecord& x, const runtime::StateRecord& truth);
  /// null when nothing was counted.
  nlohmann::json json(double radius_m) const;
};

struct Replay {
  std::int64_t ticks = 0;
  std::int64_t incomplete = 0;  // ticks of which the log lost a part
  std::size_t damaged_bytes = 0;
  std::int64_t missing = 0;  // ticks that the log lost
  Verdict verdict;           // of what the log holds; that a run was interrupted is not in its ticks
  Difference difference;
  ReplayErrors logged, other;

  bool identical() const { return ticks > 0 && missing == 0 && !difference.found; }
};

/// `other`: estimator that runs beside the one that controlled, on the same samples and inputs; empty: none.
/// `origin` names the log in errors.
Replay replay_log(RunLog& log, const std::string& origin, const std::string& other);

}  // namespace equipoise::app
