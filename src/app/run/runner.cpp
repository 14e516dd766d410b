#include "app/run/runner.hpp"

#include <cstdio>
#include <filesystem>

#include "app/cli/interrupt.hpp"
#include "app/guard/service_notify.hpp"
#include "app/io/hardware.hpp"
#include "app/remote/hand_remote.hpp"
#include "app/run/journal.hpp"
#include "app/run/trial_observer.hpp"
#include "app/run/wires.hpp"
#include "equipoise/runtime/command_receiver.hpp"

namespace equipoise::app {
namespace {

/// run.lcm, run-2.lcm, run-3.lcm: a new engine is a new trial.
std::string numbered(const std::string& path, int trial) {
  if (trial == 1 || path == "off") return path;
  const std::filesystem::path p(path);
  return (p.parent_path() / (p.stem().string() + "-" + std::to_string(trial) + p.extension().string()))
      .string();
}

/// From which those of every holder can be had.
runtime::CommandKeys robot_key(const std::string& path) {
  runtime::CommandKeys keys = runtime::CommandKeys::load(path);
  if (!keys.holder().empty())
    throw InputError(path + ": is " + keys.holder() + "'s key; the robot needs its own");
  return keys;
}

}  // namespace

Runner::Runner(const RunArguments& a, const RobotType& robot, const Overrides& overrides,
               const std::string& board_toml)
    : a_(a),
      robot_(robot.load(a.config, overrides)),
      board_toml_(board_toml),
      script_(script_for(*robot_, a.drive_mps, 2.0 * kPi * a.yaw_hz, a.path)) {
  script_.arm = a.arm;
  if (!a.command_key.empty()) {
    remote_ = std::make_unique<runtime::CommandReceiver>(
        robot_key(a.command_key),
        runtime::CommandReceiverOptions{a.robot_name, robot_->safety.command_timeout_s, journal},
        open_wire(a.command_url, runtime::WireSide::kRobot));
  } else if (!a.remote.empty()) {
    const RemoteFile file = load_remote(a.remote);
    remote_ = std::make_unique<HandRemote>(
        open_hand(file),
        HandRemote::Options{file.speed_m_s, file.turn_hz, robot_->safety.command_timeout_s, journal});
  }
}

Outcome Runner::run(rio_t io, int number, StatusIndicator* indicator, const BeginSupervision& begin) {
  runtime::Telemetry telemetry(telemetry_options(number));
  ServiceNotify service;
  const auto commands = [&](std::int64_t tick, std::int64_t) {
    service.note(tick);
    const Command asked = remote_ ? remote_->latest() : script_.at(static_cast<double>(tick + 1) * kTickS);
    return panel_ != nullptr ? panel_->limit(asked) : asked;
  };
  Hardware hardware(io);
  const auto firmware = robot_->firmware(a_.choice);
  runtime::Supervisor& supervisor = begin(telemetry.log_failed());
  TrialObserver observe(supervisor, telemetry, indicator, {a_.duration_s, !on_board()});
  const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&,
                           const runtime::TickRecord& t) {
    observe(tick, t);
    if (remote_) remote_->tell(static_cast<ArmState>(t.arm_state));
  };
  const Trial trial =
      observe.trial(runtime::run_loop(hardware, *firmware, commands, on_tick, observe.done(), supervisor));
  return outcome(trial, telemetry.finish(trial.verdict.record()), number);
}

runtime::TelemetryOptions Runner::telemetry_options(int number) const {
  runtime::TelemetryOptions options;
  options.log_path = a_.log == "off" ? "" : numbered(a_.log, number);
  options.keep_previous = true;
  options.url = a_.telemetry == "off" ? "" : a_.telemetry;
  if (a_.choice.compare) options.estimators = robot_->type->estimators;
  options.max_log_bytes = a_.log_max_mb * 1000000;
  options.min_free_bytes = a_.log_min_free_mb * 1000000;
  options.sync = on_board();
  options.wait_when_full = !on_board();  // an engine may run faster than the disk
  options.run = run_info(*robot_, a_.choice, a_.backend == "sim" ? static_cast<std::int64_t>(a_.seed) : 0);
  options.run.backend = a_.backend;
  options.run.board_toml = board_toml_;
  return options;
}

Outcome Runner::outcome(const Trial& trial, const runtime::TelemetryReport& written, int number) const {
  Outcome out;
  out.trial = trial;
  out.log = numbered(a_.log, number);
  if (!written.warning.empty() && number == 1)
    std::fprintf(stderr, "equipoise: warning: %s\n", written.warning.c_str());
  const bool ended_well = trial.error == 0 || trial.error == -ESHUTDOWN;
  out.end = interrupted.load()                                        ? "interrupted"
            : trial.verdict.fell() && trial.armed && trial.error == 0 ? "fell"
            : ended_well                                              ? "finished"
                                                                      : "device";
  if (!written.log_error.empty()) {
    out.end = "log";
    out.error = written.log_error;
  }
  return out;
}

}  // namespace equipoise::app
