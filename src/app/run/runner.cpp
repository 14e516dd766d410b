#include "app/run/runner.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <string>

#include "app/cli/interrupt.hpp"
#include "app/guard/service_notify.hpp"
#include "app/io/hardware.hpp"
#include "app/remote/hand_remote.hpp"
#include "app/run/wires.hpp"
#include "app/text/errors.hpp"
#include "equipoise/runtime/command_receiver.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {
namespace {

/// One trial: every tick is judged, recorded and shown, and the last one recognised. operator() is RT-safe.
class TrialObserver {
 public:
  /// `indicator` may be nullptr.
  TrialObserver(const runtime::Supervisor& supervisor, runtime::Telemetry& telemetry,
                StatusIndicator* indicator, const RunArguments& a)
      : supervisor_(supervisor),
        telemetry_(telemetry),
        indicator_(indicator),
        last_tick_(a.duration_s > 0.0 ? std::llround(a.duration_s * kTickHz) - 1 : INT64_MAX),
        end_on_fall_(a.backend != "board") {}

  void operator()(std::int64_t tick, const runtime::TickRecord& t) noexcept {
    const auto arm_state = static_cast<ArmState>(t.arm_state);
    judge_.observe({static_cast<double>(tick) * kTickS, t.arm, arm_state == ArmState::kArmed, t.reasons,
                    std::numeric_limits<double>::quiet_NaN(), reason_numbers(t), t.faults});
    measure(t);
    record(tick, t);
    if (indicator_ != nullptr) indicator_->tell(arm_state, t.reasons, t.battery_V);
    const bool unrecorded = (t.inhibit & kLogFailed) != 0;  // the motors are off for it
    if (tick >= last_tick_ || (judge_.lost() && end_on_fall_) || unrecorded ||
        interrupted.load(std::memory_order_relaxed))
      done_ = true;
  }

  const std::atomic<bool>& done() const noexcept { return done_; }

  Trial trial(const runtime::LoopEnd& end) const {
    Trial out = trial_;
    out.ticks = end.ticks;
    out.error = end.error;
    out.armed = judge_.armed();
    out.verdict = judge_.verdict(interrupted.load(), end.error != 0 && end.error != -ESHUTDOWN);
    return out;
  }

 private:
  void measure(const runtime::TickRecord& t) noexcept {
    if (!t.motors.enable) return;
    ++trial_.driven;
    trial_.saturated += t.saturated ? 1 : 0;
    for (const double duty : t.motors.duty) trial_.duty_max = std::max(trial_.duty_max, std::abs(duty));
  }

  void record(std::int64_t tick, const runtime::TickRecord& t) noexcept {
    record_ = t;
    record_.tick = tick;
    const runtime::TickTiming& timing = supervisor_.timing().now();
    record_.wake_late_ns = timing.wake_late_ns;
    record_.compute_ns = timing.compute_ns;
    record_.overruns = timing.overruns;
    record_.dropped_records = telemetry_.dropped();
    telemetry_.hand_over(record_);
  }

  const runtime::Supervisor& supervisor_;
  runtime::Telemetry& telemetry_;
  StatusIndicator* indicator_;
  std::int64_t last_tick_;  // INT64_MAX: until the backend or a signal ends it
  bool end_on_fall_;
  VerdictJudge judge_;
  Trial trial_;
  runtime::TickRecord record_{};
  std::atomic<bool> done_{false};
};

/// Who commands, and verdicts on sensors, on stderr; nothing where a terminal or a pipe would have to be
/// waited for.
void journal(const std::string& what) {
  const std::string line = "equipoise: " + what + "\n";
  struct stat about {};
  if (fstat(STDERR_FILENO, &about) != 0) return;
  ssize_t written = 0;
  if (S_ISREG(about.st_mode)) {
    written = write(STDERR_FILENO, line.data(), line.size());
  } else if (S_ISSOCK(about.st_mode)) {  // the system's journal
    written = send(STDERR_FILENO, line.data(), line.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  } else {
    // Opened anew: O_NONBLOCK on the descriptor itself would be everybody's who shares it.
    static const int fd = open("/proc/self/fd/2", O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (fd >= 0) written = write(fd, line.data(), line.size());
  }
  (void)written;
}

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
  TrialObserver observe(supervisor, telemetry, indicator, a_);
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
  options.watch = [verdicts = FaultVerdicts()](const runtime::TickRecord& t) mutable {
    if (const auto said = verdicts.observe(0.0, t.faults)) journal(said->sentence());
  };
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
