#include <cstring>
#include <filesystem>

#include "app/board/board.hpp"
#include "app/cli/commands.hpp"
#include "app/cli/key_file.hpp"
#include "app/cli/reasons.hpp"
#include "app/commission/self_test.hpp"
#include "app/io/lockstep.hpp"
#include "app/run/flight.hpp"
#include "app/run/service_notify.hpp"
#include "app/run/watched_flight.hpp"
#include "app/run/wires.hpp"
#include "bbb.h"
#include "equipoise/runtime/command_receiver.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
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
  double timeout_s = 5.0;
  std::int64_t log_max_mb = 200;      // half an hour
  std::int64_t log_min_free_mb = 20;  // for others on the disk
  bool arm = false;
  std::string command_key;
  std::string robot_name;
  std::string command_url = runtime::kDefaultTelemetryUrl;
  WatchOptions watch;
};

/// Who commands, in the journal.
void say_on_stderr(const std::string& what) { std::fprintf(stderr, "equipoise: %s\n", what.c_str()); }

/// As in sim: motors half a second after the start, motion after a second.
Command script(const Arguments& a, double t_s) {
  Command c;
  c.arm = a.arm && t_s >= 0.5;
  if (t_s >= 1.0) {
    c.velocity_W_m_s = Vec2(a.drive_mps, 0.0);
    c.yaw_rate_rad_s = 2.0 * kPi * a.yaw_hz;
  }
  return c;
}

struct Outcome {
  Flight flight;
  std::string end;    // finished, duration, interrupted, fell, peer_gone, timeout, protocol, device, log
  std::string error;  // one line; empty when nothing went wrong
  std::string log;
};

/// run.lcm, run-2.lcm, run-3.lcm: a new engine is a new flight.
std::string numbered(const std::string& path, int flight) {
  if (flight == 1 || path == "off") return path;
  const std::filesystem::path p(path);
  return (p.parent_path() / (p.stem().string() + "-" + std::to_string(flight) + p.extension().string()))
      .string();
}

template <class Firmware>
class Runner {
 public:
  Runner(const Arguments& a, const Overrides& overrides, const std::string& board_toml)
      : a_(a),
        loaded_(Firmware::load(a.config, overrides)),
        config_(Firmware::apply(loaded_.config, a.choice)),
        board_toml_(board_toml) {
    if (!a.command_key.empty()) {
      receiver_ = std::make_unique<runtime::CommandReceiver>(
          load_robot_key(a.command_key),
          runtime::CommandReceiverOptions{a.robot_name, config_.safety.command_timeout_s, say_on_stderr},
          open_wire(a.command_url, runtime::WireSide::kRobot));
    }
  }

  const Calibration& calibration() const { return config_.calibration; }

  /// `watched(f)` calls f with the loop's supervisor.
  template <class Watched>
  Outcome fly_once(rio_t io, int number, Announcer* announcer, Watched&& watched) {
    Outcome outcome;
    outcome.log = numbered(a_.log, number);
    runtime::TelemetryOptions options;
    options.log_path = outcome.log == "off" ? "" : outcome.log;
    options.keep_previous = true;
    options.url = a_.telemetry == "off" ? "" : a_.telemetry;
    if (a_.choice.compare) options.estimators = Firmware::estimators();
    options.max_log_bytes = a_.log_max_mb * 1000000;
    options.min_free_bytes = a_.log_min_free_mb * 1000000;
    options.sync = a_.backend == "board";
    options.wait_when_full = a_.backend != "board";  // an engine may run faster than the disk
    options.run = run_info<Firmware>(loaded_, a_.choice, 0);
    options.run.backend = a_.backend;
    options.run.board_toml = board_toml_;
    runtime::Telemetry telemetry(options);
    const FlightLimits limits{a_.duration_s, a_.backend != "board"};
    outcome.flight = Firmware::with_pipeline(config_, a_.choice.controller, [&](auto& pipeline) {
      ServiceNotify service;
      const auto commands = [&](std::int64_t tick, std::int64_t) {
        service.tick(tick);
        return receiver_ ? receiver_->latest() : script(a_, static_cast<double>(tick) * kTickS);
      };
      return watched([&](auto& supervisor) {
        return app::fly(io, pipeline, commands, limits, supervisor, telemetry, announcer, receiver_.get());
      });
    });
    const runtime::TelemetryReport report = telemetry.finish();
    if (!report.warning.empty() && number == 1)
      std::fprintf(stderr, "equipoise: warning: %s\n", report.warning.c_str());
    const Flight& f = outcome.flight;
    outcome.end = interrupted.load()                      ? "interrupted"
                  : f.fell && f.error == 0                ? "fell"
                  : f.error == 0 || f.error == -ESHUTDOWN ? "finished"
                                                          : "device";
    if (!report.log_error.empty()) {
      outcome.end = "log";
      outcome.error = report.log_error;
    }
    return outcome;
  }

  const std::string& sha256() const { return loaded_.sha256; }

 private:
  const Arguments& a_;
  typename Firmware::Loaded loaded_;
  typename Firmware::Config config_;
  std::string board_toml_;
  std::unique_ptr<runtime::CommandReceiver> receiver_;  // null: the script
};

nlohmann::json to_json(const Arguments& a, const std::string& robot, const Outcome& o, int flights,
                       const std::string& sha256, const nlohmann::json& watch) {
  const Flight& f = o.flight;
  nlohmann::json out{{"robot", robot},
                     {"backend", a.backend},
                     {"estimator", a.choice.estimator},
                     {"controller", a.choice.controller},
                     {"duration_s", f.duration_s()},
                     {"ticks", f.ticks},
                     {"armed", f.armed},
                     {"fell", f.fell},
                     {"fell_at_s", f.fell ? nlohmann::json(f.fell_at_s) : nlohmann::json(nullptr)},
                     {"reasons", reason_names(f.reasons)},
                     {"duty_max", f.duty_max},
                     {"saturated_fraction",
                      f.driven > 0 ? static_cast<double>(f.saturated) / static_cast<double>(f.driven) : 0.0},
                     {"flights", flights},
                     {"end", o.end},
                     {"error", o.error.empty() ? nlohmann::json(nullptr) : nlohmann::json(o.error)},
                     {"log", o.log},
                     {"config_sha256", sha256},
                     {"version", version()}};
  if (!watch.is_null()) out.update(watch);
  return out;
}

/// `watch`: guard, realtime, timing; null: nobody watched.
int report(const Arguments& a, const std::string& robot, Outcome o, int flights, const std::string& sha256,
           const nlohmann::json& watch = nullptr) {
  const Flight& f = o.flight;
  if (o.error.empty() && f.fell)
    o.error = "the motors went off at " + std::to_string(f.fell_at_s) + " s: " + reasons_text(f.reasons);
  if (o.error.empty() && a.arm && a.command_key.empty() && !f.armed && f.duration_s() > 0.6)
    o.error = "the robot never armed: " + reasons_text(f.reasons);
  std::FILE* const out = a.json == "-" ? stderr : stdout;
  std::fprintf(out, "%s after %.1f s  (%s, %s, %s)\n",
               f.fell    ? "FELL"
               : f.armed ? "Upright"
                         : "Never armed",
               f.duration_s(), a.backend.c_str(), a.choice.estimator.c_str(), a.choice.controller.c_str());
  std::fprintf(out, "  duty max        %8.3f\n  log             %s\n", f.duty_max, o.log.c_str());
  if (!a.json.empty()) write_json(to_json(a, robot, o, flights, sha256, watch), a.json);
  if (o.error.empty()) return 0;
  std::fprintf(stderr, "equipoise: %s; motors are off\n", o.error.c_str());
  return 1;
}

const char* name_of(LockstepEnd end) {
  switch (end) {
    case LockstepEnd::kPeerGone:
      return "peer_gone";
    case LockstepEnd::kTimeout:
      return "timeout";
    case LockstepEnd::kProtocol:
      return "protocol";
    case LockstepEnd::kRunning:
    case LockstepEnd::kFinished:
      break;
  }
  return "finished";
}

template <class Firmware>
int run_lockstep(const Arguments& a) {
  Runner<Firmware> runner(a, a.set, "");
  const LockstepServer server(a.socket);
  std::fprintf(stderr, "waiting for a physics engine on %s\n", a.socket.c_str());
  const auto nobody = [](auto&& fly) {  // an engine's time has no deadlines
    runtime::NoSupervisor supervisor;
    return fly(supervisor);
  };
  Outcome last;
  int flights = 0;
  for (;;) {
    const int fd = server.accept_engine(a.timeout_s);
    if (fd < 0) {
      if (interrupted.load()) last.end = "interrupted";
      if (flights > 0 || interrupted.load()) break;  // the last flight's error says it
      last.end = "timeout";
      last.error =
          "no physics engine connected to " + a.socket + " within " + std::to_string(a.timeout_s) + " s";
      break;
    }
    Lockstep engine(fd, runner.calibration(), a.timeout_s);
    last = runner.fly_once(engine.io(), ++flights, nullptr, nobody);
    if (engine.end() != LockstepEnd::kRunning && engine.end() != LockstepEnd::kFinished &&
        !last.flight.fell) {
      last.end = name_of(engine.end());
      last.error = engine.error();
    }
    if (engine.end() != LockstepEnd::kPeerGone || interrupted.load()) break;
    std::fprintf(stderr, "equipoise: %s; motors are off, waiting for another\n", last.error.c_str());
  }
  return report(a, Firmware::kName, last, flights, runner.sha256());
}

template <class Firmware>
int run_board(const Arguments& a, const Board& board, const std::string& board_toml) {
  const Overrides overrides = overrides_of(board, a.set);
  FlightWatch watch(a.watch);  // before the receiver's thread, and before the board is opened
  Runner<Firmware> runner(a, overrides, board_toml);
  rio_t io{};
  bbb_error_t error{};
  bbb_config_t wiring = board.wiring;
  wiring.enable_held_elsewhere = a.watch.guard;
  if (bbb_open(&wiring, &io, &error) < 0)
    throw std::runtime_error(a.board + ": " + error.text + " (equipoise doctor finds the cause)");
  const std::string broken = self_test(io);
  if (!broken.empty()) {
    rio_close(&io);
    throw std::runtime_error(a.board + ": self-test: " + broken);
  }
  Announcer announcer(board);
  Outcome outcome = runner.fly_once(io, 1, &announcer,
                                    [&](auto&& fly) { return watch.fly(std::forward<decltype(fly)>(fly)); });
  if (outcome.end == "device")
    outcome.error = std::string("the board's tick failed: ") + std::strerror(-outcome.flight.error);
  return report(a, Firmware::kName, outcome, 1, runner.sha256(), watch.summary());
}

int run(Arguments a) {
  a.choice.backend = a.backend;
  if (a.backend == "lockstep" && a.socket.empty()) throw InputError("--backend lockstep needs --socket PATH");
  if (a.backend == "board" && a.board.empty())
    throw InputError("--backend board needs --board FILE, e.g. config/boards/robotics_cape_mbbr.toml");
  const std::string robot = robot_type(a.config);
  if (a.log.empty()) {
    std::filesystem::create_directories("logs");
    a.log = "logs/run-" + a.backend + ".lcm";
  }
  a.watch.board_path = a.board;
  watch_interrupts();
  return with_robot(robot, a.config, [&](auto firmware) {
    using Firmware = decltype(firmware);
    complete<Firmware>(a.choice);
    if (a.choice.estimator == "truth")
      throw InputError("--estimator truth: only a simulation knows the truth");
    if (a.backend == "lockstep") return run_lockstep<Firmware>(a);
    const Board board = load_board(a.board);
    const bool wired_for_it = board.robot == Firmware::kName;
    if (!wired_for_it) {
      throw InputError(a.board + ": board.robot: \"" + board.robot + "\" where " + a.config + " says \"" +
                       Firmware::kName + "\"");
    }
    if (a.command_url == "serial")
      a.command_url = "serial:" + board.serial_device + ":" + std::to_string(board.serial_baud);
    if (a.command_url == "can") a.command_url = "can:" + board.can_interface;
    return run_board<Firmware>(a, board, read_text(a.board));
  });
}

}  // namespace

void add_run(Subcommand app) {
  const Subcommand command =
      app.subcommand("run", "Flies the robot: on its board, or against a physics engine");
  auto a = std::make_shared<Arguments>();
  command.option("--config", a->config, "robot configuration, TOML").required();
  command.option("--backend", a->backend, "board or lockstep").show_default().one_of({"board", "lockstep"});
  command.option("--board", a->board, "wiring, TOML; see config/boards");
  command.option("--socket", a->socket, "lockstep: where to listen, a Unix SOCK_SEQPACKET path");
  command.option("--timeout-s", a->timeout_s, "lockstep: longest wait for the engine, s")
      .show_default()
      .range(0.01, 3600.0);
  command.option("--duration-s", a->duration_s, "stop after this long, s; 0: when told to")
      .show_default()
      .range(0.0, 360000.0);
  command.option("--yaw-hz", a->yaw_hz, "yaw rate, turns per second").range(-5.0, 5.0);
  command.option("--drive-mps", a->drive_mps, "drive speed, m/s").range(-2.0, 2.0);
  const Option arm = command.flag("--arm,!--no-arm", a->arm,
                                  "request the motors 0.5 s after the start (default: lockstep only)");
  command.option("--command-key", a->command_key,
                 "take commands of holders of this key (keygen, send) instead of the script");
  command
      .option("--command-url", a->command_url,
              std::string("where to listen with --command-key: ") + kWireHelp +
                  "; on a board also serial or can, as its file says")
      .show_default();
  command.option("--robot-name", a->robot_name, "its name for senders (default: as in the key)");
  command.option("--estimator", a->choice.estimator, "who controls (default: the robot's)");
  command.option("--controller", a->choice.controller, "state feedback (default: the robot's)");
  command.flag("--compare", a->choice.compare, "run every estimator on the same samples");
  command.option("--set", a->set, "override a configuration key, e.g. --set friction.compensation=0.8");
  command.option("--log", a->log,
                 "LCM event log, or off; an earlier one of this name is kept under the time it ended "
                 "(default: logs/run-BACKEND.lcm)");
  command.option("--log-max-mb", a->log_max_mb, "continue the log in a further file after this much, MB")
      .show_default()
      .range(1, 100000);
  command.option("--log-min-free-mb", a->log_min_free_mb, "delete the run's oldest files below this, MB")
      .show_default()
      .range(0, 1000000);
  command.option("--json", a->json, "summary as JSON, - for stdout");
  command.flag("--guard,!--no-guard", a->watch.guard,
               "board: a process that stops the motors when this one dies or hangs (default: yes)");
  command.flag("--realtime,!--without-realtime", a->watch.realtime,
               "board: motors only under real-time scheduling (default: yes)");
  command.option("--cpu", a->watch.cpu, "board: the loop's CPU; -1: any").show_default().range(-1, 1023);
  command.option("--priority", a->watch.priority, "board: the loop's SCHED_FIFO priority, below the guard's")
      .show_default()
      .range(1, runtime::kGuardPriority - 1);
  command.option("--telemetry", a->telemetry, "LCM provider URL, or off").show_default();
  command.action([=] {
    if (!arm.given()) a->arm = a->backend == "lockstep";
    return run(*a);
  });
}

}  // namespace equipoise::app
