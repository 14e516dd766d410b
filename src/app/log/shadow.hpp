// The firmware beside a robot that somebody else drove: its pipeline on a log's sensors with the log's own
// input, seeded in motion, started anew after a fault. In: a log, a configuration -> out: what it would have
// raised, how well its noises and its model fit, how its tilt compares with a smoother's. Not RT-safe.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "app/log/run_log.hpp"
#include "app/text/json.hpp"
#include "app/trial/root_mean_square.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

struct ShadowAlarm {
  double t_s = 0.0;
  std::string hypothesis;  // names of reasons and of degraded modes
  double ratio = 0.0;      // the statistic that decided; NaN: not one number
  double bound = 0.0;
};

/// Errors of what is said about a moment ahead: by the model with the input that acts, by nothing changing,
/// by the rate staying.
struct Ahead {
  struct Errors {
    RootMeanSquare tilt, wheel;
  };
  Errors model, persistence, constant_rate;
};

struct Shadow {
  double judged_s = 0.0;      // armed, by the pipeline
  int starts = 0;             // the first included
  std::uint32_t refused = 0;  // SafetyReason bits of starts without arming, and of faults
  std::vector<ShadowAlarm> alarms;
  Vec2 mount_rad = Vec2::Zero();                      // that the log tells, beside the configured one
  std::map<std::string, RootMeanSquare> nis;          // per row: root mean of NIS; 1: as the filter believes
  std::array<std::vector<double>, 2> tilt_error_rad;  // roll, pitch against the smoother
  std::vector<double> own_tilt_error_rad;             // against the log's own
  std::map<std::string, Ahead> ahead;
  std::map<std::string, RootMeanSquare> noise;  // of the samples: second differences, as white noise
  std::map<std::string, double> configured;     // of the configuration's world `full`

  nlohmann::json json() const;
  void print(std::FILE* out) const;
};

/// `config`: path; empty: the log's own. `set`: as of --set.
Shadow shadow_log(RunLog& log, const std::string& origin, const std::string& config,
                  const std::vector<std::string>& set);

}  // namespace equipoise::app
