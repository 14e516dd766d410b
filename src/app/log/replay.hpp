// A log's samples, commands and inhibit bits through the pipeline again, and what differs. In: a log -> out:
// the first difference from what it holds, bit for bit; asked for, another estimator or another tuning beside
// it. InputError when the log holds no whole tick or its choices are unknown.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/log/run_log.hpp"
#include "app/text/json.hpp"
#include "app/trial/firmware.hpp"
#include "app/trial/verdict.hpp"

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

/// Another tuning on the run's samples, commands and inputs, over the ticks in which the run was armed, after
/// its first five seconds.
struct Retuned {
  /// Of one tuning, summed over the ticks.
  struct Figures {
    ReplayErrors errors;        // against the truth
    double duty_squared = 0.0;  // mean of the motors
    double innovation = 0.0;    // normalised: 1 when the noise is as the filter believes
    std::int64_t saturated = 0;

    nlohmann::json json(std::int64_t ticks, double radius_m) const;
  };
  Figures recorded, changed;
  ReplayErrors difference;     // of the estimates
  std::int64_t not_armed = 0;  // ticks in which this tuning would have taken the motors away
  std::uint32_t reasons = 0;   // why
};

struct Replay {
  std::int64_t ticks = 0;
  std::int64_t incomplete = 0;  // ticks of which the log lost a part
  std::size_t damaged_bytes = 0;
  std::int64_t missing = 0;  // ticks that the log lost
  Verdict verdict;           // the run's own; of a log that was cut off, what its ticks say
  SafetyParams safety;       // as the run was configured
  Difference difference;
  ReplayErrors logged, other;
  std::optional<Retuned> retuned;

  bool identical() const { return ticks > 0 && missing == 0 && !difference.found; }
};

/// RunInfo::backend of a log that `replay` wrote.
inline constexpr const char* kReplayBackend = "replay";

/// What runs beside the recorded run.
struct Beside {
  std::string estimator;         // empty: none, or the recorded one
  std::vector<std::string> set;  // changes of the configuration, as of --set; empty: the recorded tuning
  std::string log{};             // of the changed tuning's ticks; empty: none
};

/// `origin` names the log in errors.
Replay replay_log(RunLog& log, const std::string& origin, const Beside& beside);
/// The same, of a robot that need not be one of this build.
Replay replay_as(const RobotType& robot, RunLog& log, const std::string& origin, const Beside& beside = {});

// Parts of a replay, for its tests.

/// The first number that differs: bit for bit, but any NaN is any other.
void compare(const runtime::TickRecord& logged, const runtime::TickRecord& replayed, Difference* difference);

/// As the run judged it.
VerdictJudge::Tick judged(const runtime::TickRecord& r) noexcept;

/// What counts, as in sim: from the fifth second on; simulated clocks start at 0.
bool settled(const runtime::TickRecord& r) noexcept;

}  // namespace equipoise::app
