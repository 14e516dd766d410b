// What `equipoise run` is asked for, what comes of it, and how that is told. In: command line, outcome ->
// out: JSON, text, exit status.
#pragma once

#include <cstdint>

#include "app/run/realtime_session.hpp"
#include "app/trial/firmware.hpp"
#include "app/trial/verdict.hpp"
#include "equipoise/runtime/telemetry.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

struct Trial {
  Verdict verdict;
  std::int64_t ticks = 0;
  int error = 0;       // -errno that ended the ticks; -ESHUTDOWN: the backend had no more
  bool armed = false;  // at least once
  double duty_max = 0.0;
  std::int64_t driven = 0;
  std::int64_t saturated = 0;

  double duration_s() const { return static_cast<double>(ticks) * kTickS; }
};

struct RunArguments {
  std::string config;
  std::string backend = "board";
  std::string board;
  std::string socket;
  Choice choice;
  std::vector<std::string> set;
  std::string log;
  std::string json;
  std::string telemetry = runtime::kDefaultTelemetryUrl;
  double duration_s = 0.0;
  double yaw_hz = 0.0;
  double drive_mps = 0.0;
  std::string path;
  double timeout_s = 5.0;
  double speed = 1.0;                 // sim: simulated seconds per second
  std::vector<std::string> faults;    // sim: NAME@T
  std::int64_t robot_number = 0;      // sim: of the population
  std::uint64_t seed = 1;             // sim
  std::int64_t log_max_mb = 200;      // half an hour
  std::int64_t log_min_free_mb = 20;  // for others on the disk
  bool arm = false;
  std::string command_key;
  std::string remote;
  std::string robot_name;
  std::string command_url = runtime::kDefaultTelemetryUrl;
  SessionOptions session;
};

struct Outcome {
  Trial trial;
  std::string end;    // finished, interrupted, fell, peer_gone, timeout, protocol, device, log
  std::string error;  // one line; empty when nothing went wrong
  std::string log;
};

/// Writes text and JSON; the exit status. `session`: guard, realtime, timing; null: an engine's time.
int report(const RunArguments& a, const ConfiguredRobot& robot, Outcome outcome, int trials,
           const nlohmann::json& session);

}  // namespace equipoise::app
