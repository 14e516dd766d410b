// `equipoise run`: the robot on its board, against a physics engine, or in a simulated world to practise.
#include <cstring>

#include "app/board/board.hpp"
#include "app/board/self_test.hpp"
#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/io/lockstep.hpp"
#include "app/io/plant_backend.hpp"
#include "app/io/practice_backend.hpp"
#include "app/run/runner.hpp"
#include "app/run/wires.hpp"
#include "app/text/files.hpp"
#include "app/text/format.hpp"
#include "bbb.h"
#include "config/population.hpp"
#include "equipoise/runtime/command_key.hpp"

namespace equipoise::app {
namespace {

int run_lockstep(const RunArguments& a, const RobotType& robot) {
  Runner runner(a, robot, a.set, "");
  const LockstepServer server(a.socket);
  std::fprintf(stderr, "waiting for a physics engine on %s\n", a.socket.c_str());
  std::optional<runtime::Supervisor> supervisor;
  const BeginSupervision begin = [&](const std::atomic<bool>& log_failed) -> runtime::Supervisor& {
    return supervisor.emplace(runtime::Watched{nullptr, 0, &log_failed, true});  // an engine's time
  };
  Outcome last;
  int trials = 0;
  for (;;) {
    const int fd = server.accept_engine(a.timeout_s);
    if (fd < 0) {
      if (interrupted.load()) last.end = "interrupted";
      if (trials > 0 || interrupted.load()) break;  // the last trial's error says it
      last.end = "timeout";
      last.error = "no physics engine connected to " + a.socket + format(" within %g s", a.timeout_s);
      last.trial.verdict.ended = Ended::kDevice;
      break;
    }
    Lockstep engine(fd, runner.robot().calibration, a.timeout_s);
    last = runner.run(engine.io(), ++trials, nullptr, begin);
    if (engine.end() != LockstepEnd::kRunning && engine.end() != LockstepEnd::kFinished &&
        last.end != "fell") {
      last.end = kLockstepEndNames[static_cast<std::size_t>(engine.end())];
      last.error = engine.error();
    }
    if (engine.end() != LockstepEnd::kPeerGone || interrupted.load()) break;
    std::fprintf(stderr, "equipoise: %s; motors are off, waiting for another\n", last.error.c_str());
  }
  return report(a, runner.robot(), last, trials, nullptr);
}

/// What `sim` simulates, behind what the board runs.
int run_simulated(const RunArguments& a, const RobotType& robot) {
  Runner runner(
      a, robot,
      config::with_robot_drawn(config::draw_robot(a.config, a.set, a.choice.fidelity, a.robot_number),
                               a.choice.fidelity, a.set),
      "");
  std::vector<PlannedFault> faults;
  std::transform(a.faults.begin(), a.faults.end(), std::back_inserter(faults), planned_fault);
  const auto world = runner.robot().world(a.choice, a.seed);
  PlantBackend simulated(*world);
  PracticeBackend practice(simulated.io(), a.speed, faults, a.seed);
  std::optional<runtime::Supervisor> supervisor;
  const Outcome outcome =
      runner.run(practice.io(), 1, nullptr, [&](const std::atomic<bool>& log_failed) -> runtime::Supervisor& {
        const std::atomic<bool>& failed = practice.breaks_log() ? practice.log_failed() : log_failed;
        return supervisor.emplace(runtime::Watched{nullptr, 0, &failed, true});  // simulated time
      });
  return report(a, runner.robot(), outcome, 1, nullptr);
}

int run_board(const RunArguments& a, const RobotType& robot, const Board& board,
              const std::string& board_toml) {
  const Overrides overrides = overrides_of(board, a.set);
  // Before the receiver's thread, and before the board is opened.
  RealtimeSession session(a.session, missing_calibration(board));
  Runner runner(a, robot, overrides, board_toml);
  rio_t io{};
  bbb_error_t error{};
  bbb_config_t wiring = board.wiring;
  wiring.enable_held_elsewhere = a.session.guard;
  if (bbb_open(&wiring, &io, &error) < 0)
    throw std::runtime_error(a.board + ": " + error.text + " (equipoise doctor finds the cause)");
  const std::string broken = self_test(io);
  if (!broken.empty()) {
    rio_close(&io);
    throw std::runtime_error(a.board + ": self-test: " + broken);
  }
  StatusIndicator indicator(board);
  Panel panel(board);
  runner.obey(&panel);
  Outcome outcome = runner.run(io, 1, &indicator, [&](const auto& log_failed) -> runtime::Supervisor& {
    return session.begin(log_failed);
  });
  session.end();
  if (outcome.end == "device")
    outcome.error = std::string("the board's tick failed: ") + std::strerror(-outcome.trial.error);
  return report(a, runner.robot(), outcome, 1, session.summary());
}

int run(RunArguments a) {
  a.choice.backend = a.backend;
  if (a.backend != "sim") a.choice.fidelity.clear();
  if (!a.robot_name.empty() && !runtime::is_command_name(a.robot_name))
    throw InputError("--robot-name \"" + a.robot_name +
                     "\": one to sixteen letters, digits, '-', '_' and '.', or no sender can name it");
  if (a.backend == "lockstep" && a.socket.empty()) throw InputError("--backend lockstep needs --socket PATH");
  if (a.backend == "board" && a.board.empty())
    throw InputError("--backend board needs --board FILE, e.g. config/boards/robotics_cape_mbbr.toml");
  const RobotType& robot = robot_type_of(robot_type(a.config), a.config);
  if (a.log.empty()) a.log = new_log_name(a.backend, robot.name);
  a.session.board_path = a.board;
  watch_interrupts();
  complete(robot, &a.choice);
  if (a.choice.estimator == "truth") throw InputError("--estimator truth: only a simulation knows the truth");
  if (a.backend == "lockstep") return run_lockstep(a, robot);
  if (a.backend == "sim") return run_simulated(a, robot);
  const Board board = load_board(a.board);
  if (board.robot.compare(robot.name) != 0) {
    throw InputError(a.board + ": board.robot: \"" + board.robot + "\" where " + a.config + " says \"" +
                     robot.name + "\"");
  }
  if (a.command_url == "serial")
    a.command_url = "serial:" + board.serial_device + ":" + std::to_string(board.serial_baud);
  if (a.command_url == "can") a.command_url = "can:" + board.can_interface;
  return run_board(a, robot, board, read_text(a.board));
}

}  // namespace

void add_run(Subcommand app) {
  const Subcommand command =
      app.subcommand("run", "Runs the robot: on its board, against a physics engine, or simulated")
          .example("equipoise run --config config/mbbr.toml --backend sim --duration-s 30");
  auto a = std::make_shared<RunArguments>();
  command.option("--config", a->config, "robot configuration, TOML").file().required();
  command
      .option("--backend", a->backend,
              "board; lockstep: an external physics engine; sim: our world in real time, to practise")
      .show_default()
      .one_of({"board", "lockstep", "sim"});
  command.option("--board", a->board, "wiring, TOML; see config/boards").file();
  command.option("--socket", a->socket, "lockstep: where to listen, a Unix SOCK_SEQPACKET path").file();
  command.option("--timeout-s", a->timeout_s, "lockstep: longest wait for the engine, s")
      .show_default()
      .range(0.01, 3600.0);
  command.option("--speed", a->speed, "sim: simulated seconds per second").show_default().range(0.01, 1000.0);
  command.option(
      "--fault", a->faults,
      "sim: break a part, NAME@T or NAME@T+D: at T seconds, for D seconds; an unknown name lists them");
  a->choice.fidelity = "built2025";
  command.option("--fidelity", a->choice.fidelity, "sim: which world").show_default().one_of(kFidelityNames);
  command.option("--robot", a->robot_number, "sim: draw this robot from [population]; 0: the typical one")
      .show_default()
      .range(0.0, 1e12);
  command.option("--seed", a->seed, "sim: of every random number").show_default();
  command.option("--duration-s", a->duration_s, "stop after this long, s; 0: until stopped")
      .show_default()
      .range(0.0, 360000.0);
  const Option yaw = command.option("--yaw-hz", a->yaw_hz, "yaw rate, turns per second").range(-5.0, 5.0);
  const Option drive = command.option("--drive-mps", a->drive_mps, "drive speed, m/s").range(-2.0, 2.0);
  const Option path = command.option("--path", a->path, kPathHelp);
  const Option arm = command.flag("--arm,!--no-arm", a->arm,
                                  "request the motors 0.5 s after the start (default: not on a board)");
  const Option key = command
                         .option("--command-key", a->command_key,
                                 "take commands of holders of this key (keygen, send) instead of the script")
                         .file();
  const Option remote =
      command
          .option(
              "--remote", a->remote,
              "take commands of a gamepad, a keyboard or an app through an HC-06 instead of the script: a "
              "file, see remote learn and config/remotes")
          .file()
          .excludes(key);
  // Of the script, which nobody follows when somebody commands.
  for (const Option& scripted : {yaw, drive, path}) scripted.excludes(key).excludes(remote);
  command.option("--robot-name", a->robot_name, "its name for senders (default: as in the key)");
  command
      .option("--command-url", a->command_url,
              std::string("where to listen with --command-key: ") + kWireHelp +
                  "; on a board also serial or can, as its file says")
      .show_default();
  command.option("--estimator", a->choice.estimator, "which estimator controls (default: the robot's)");
  command.option("--controller", a->choice.controller, "state feedback (default: the robot's)");
  command.flag("--compare", a->choice.compare, "run every estimator on the same samples");
  command.option("--set", a->set, "override a configuration key, e.g. --set friction.compensation=0.8");
  command
      .option("--log", a->log,
              "LCM event log, or off; an earlier one of this name is kept under the time it ended "
              "(default: logs/BACKEND-ROBOT-TIME.lcm)")
      .file();
  command.option("--log-max-mb", a->log_max_mb, "continue the log in a further file after this much, MB")
      .show_default()
      .range(1, 100000);
  command.option("--log-min-free-mb", a->log_min_free_mb, "delete the run's oldest files below this, MB")
      .show_default()
      .range(0, 1000000);
  command.option("--json", a->json, "summary as JSON, - for stdout").file();
  command.flag("--guard,!--no-guard", a->session.guard,
               "board: a process that stops the motors when this one dies or hangs (default: yes)");
  command.flag("--realtime,!--without-realtime", a->session.realtime,
               "board: motors only under real-time scheduling (default: yes)");
  command.flag("--calibrated,!--without-calibration", a->session.calibrated,
               "board: motors only with the gyro and accelerometer calibrated (default: yes)");
  command.option("--cpu", a->session.cpu, "board: the loop's CPU; -1: any").show_default().range(-1, 1023);
  command
      .option("--priority", a->session.priority, "board: the loop's SCHED_FIFO priority, below the guard's")
      .show_default()
      .range(1, runtime::kGuardPriority - 1);
  command.option("--telemetry", a->telemetry, "LCM provider URL, or off").show_default();
  command.action([=] {
    if (!arm.given()) a->arm = a->backend != "board";
    return run(*a);
  });
}

}  // namespace equipoise::app
