#include "app/commission/commissioning.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "app/board/self_test.hpp"
#include "app/cli/interrupt.hpp"
#include "app/text/errors.hpp"
#include "bbb.h"
#include "robots/robot_list.hpp"

namespace equipoise::app {
namespace {

// Tipping by a positive angle about the axis; contact of wheel i: [T] (2.3)-(2.5), opposite its azimuth.
const char* const kTipMbbr =
    "tip the robot by about 40 degrees towards +x, which is a ninth of a turn from wheel 1 on the way to "
    "wheel 3";
const char* const kTipMip =
    "tip the robot by about 40 degrees forwards, the way it drives when its wheels turn up";

Vec3 tip_axis(const MbbrParameters&) { return Vec3::UnitY(); }
Vec3 tip_axis(const MipParameters&) { return Vec3::UnitX(); }
const char* words_for_tip(const MbbrParameters&) { return kTipMbbr; }
const char* words_for_tip(const MipParameters&) { return kTipMip; }

/// poll, unlike getline, comes back on Ctrl-C.
bool ask_person(const Request& request, std::string* answer) {
  std::fprintf(stderr, "%s (q: stop)\n> ", request.text.c_str());
  answer->clear();
  for (;;) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    if (interrupted.load()) return false;
    if (poll(&input, 1, -1) < 0) {
      if (errno == EINTR) continue;
      return false;
    }
    char c = 0;
    if (read(STDIN_FILENO, &c, 1) != 1) return false;
    if (c == '\n') return *answer != "q";
    *answer += c;
  }
}

}  // namespace

void add_options(Subcommand command, CommissioningArguments* a) {
  command.option("--config", a->config, "robot configuration, TOML").file().required();
  command.option("--board", a->board, "wiring, TOML; see config/boards").file().required();
  command.option("--backend", a->backend, "board, or stand: a simulated robot to practise on")
      .show_default()
      .one_of({"board", "stand"});
  command.option("--seed", a->seed, "of the simulated stand's sensors").show_default();
  command.option("--practice-fault", a->faults, "on the simulated stand, e.g. motor-1-reversed");
}

Commissioning::Commissioning(const CommissioningArguments& a)
    : robot_(robot_type(a.config)), board_path_(a.board), board_(load_wiring(a.board)) {
  if (board_.robot.compare(robot_) != 0) {
    throw InputError(a.board + ": board.robot: \"" + board_.robot + "\" where " + a.config + " says \"" +
                     robot_ + "\"");
  }
  with_robot(robot_, a.config, [&](auto firmware) {
    using Firmware = decltype(firmware);
    const auto config = Firmware::load(a.config, overrides_of(board_)).config;
    setup_.layout = layout_of(config.robot, config.motor, config.calibration);
    setup_.tip_axis_B = tip_axis(config.robot);
    setup_.motor = config.motor;
    setup_.calibration = config.calibration;
    setup_.world = config.world[static_cast<std::size_t>(Fidelity::kNominal)].common;
    tip_words_ = words_for_tip(config.robot);
  });
  const Calibration& c = setup_.calibration;
  const bool turned =
      std::any_of(c.motor_sign.begin(), c.motor_sign.end(), [](double s) { return s < 0.0; }) ||
      std::any_of(c.encoder_sign.begin(), c.encoder_sign.end(), [](double s) { return s < 0.0; });
  if (turned)
    throw InputError(a.config +
                     ": calibration.motor_sign and encoder_sign must be 1: the board file turns signs");
  if (static_cast<int>(board_.wiring.motors) != setup_.layout.wheels)
    throw InputError(a.board + ": motor: " + std::to_string(board_.wiring.motors) +
                     " motors where the robot has " + std::to_string(setup_.layout.wheels));
  if (a.backend == "stand") {
    setup_.world.seed = static_cast<std::uint64_t>(a.seed);
    stand_ = std::make_unique<SimulatedStand>(setup_, parse_faults(a.faults, setup_.layout.wheels));
  } else if (!a.faults.empty()) {
    throw InputError("--practice-fault needs --backend stand");
  }
  watch_interrupts();
}

std::unique_ptr<ManualDrive> Commissioning::open() {
  rio_t io{};
  Ask ask = ask_person;
  if (on_stand()) {
    io = stand_->io();
    ask = stand_->ask();
  } else {
    if (guard_ == nullptr) guard_ = std::make_unique<GuardProcess>(board_path_);
    bbb_error_t error{};
    bbb_config_t wiring = board_.wiring;
    wiring.enable_held_elsewhere = true;
    if (bbb_open(&wiring, &io, &error) < 0)
      throw std::runtime_error(board_path_ + ": " + error.text + " (equipoise doctor --board " + board_path_ +
                               " finds the cause)");
  }
  auto manual = std::make_unique<ManualDrive>(io, std::move(ask), guard_ ? &guard_->page() : nullptr);
  const std::string broken = self_test(io);
  if (!broken.empty()) throw std::runtime_error(board_path_ + ": self-test: " + broken);
  return manual;
}

void Commissioning::change_board(const Board& board) {
  if (on_stand()) stand_->rewire(board_, board);
  board_ = board;
}

}  // namespace equipoise::app
