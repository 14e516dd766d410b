// Runs trials of one robot: configuration, firmware, commands, telemetry, then one loop per trial. In:
// arguments, overrides, an open backend, who supervises -> out: Outcome.
#pragma once

#include <functional>
#include <memory>

#include "app/run/panel.hpp"
#include "app/run/run_arguments.hpp"
#include "app/run/status_indicator.hpp"
#include "app/trial/script.hpp"
#include "equipoise/runtime/remote.hpp"
#include "equipoise/runtime/supervisor.hpp"
#include "robot_io.h"

namespace equipoise::app {

/// In the loop's thread, just before its first tick.
using BeginSupervision = std::function<runtime::Supervisor&(const std::atomic<bool>& log_failed)>;

class Runner {
 public:
  Runner(const RunArguments& a, const RobotType& robot, const Overrides& overrides,
         const std::string& board_toml);

  const ConfiguredRobot& robot() const { return *robot_; }
  void obey(Panel* panel) { panel_ = panel; }

  Outcome run(rio_t io, int number, StatusIndicator* indicator, const BeginSupervision& begin);

 private:
  bool on_board() const { return a_.backend == "board"; }
  runtime::TelemetryOptions telemetry_options(int number) const;
  Outcome outcome(const Trial& trial, const runtime::TelemetryReport& written, int number) const;

  const RunArguments& a_;
  std::unique_ptr<const ConfiguredRobot> robot_;
  std::string board_toml_;
  Script script_;
  std::unique_ptr<runtime::Remote> remote_;  // null: the script
  Panel* panel_ = nullptr;                   // null: no buttons
};

}  // namespace equipoise::app
