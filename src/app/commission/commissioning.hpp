// Where calibrate and bringup work: the robot on its board or a simulated stand, and who answers questions.
// In: command line -> out: robots under manual drive. Start-up only.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "app/cli/command_line.hpp"
#include "app/commission/manual_drive.hpp"
#include "app/commission/simulated_stand.hpp"
#include "app/guard/guard_process.hpp"

namespace equipoise::app {

struct CommissioningArguments {
  std::string config;
  std::string board;
  std::string backend = "board";
  std::int64_t seed = 1;
  std::vector<std::string> faults;
};

void add_options(Subcommand command, CommissioningArguments* a);

class Commissioning {
 public:
  explicit Commissioning(const CommissioningArguments& a);

  const std::string& robot() const { return robot_; }
  const Board& board() const { return board_; }
  const StandSetup& setup() const { return setup_; }
  const WheelLayout& layout() const { return setup_.layout; }
  const Calibration& calibration() const { return setup_.calibration; }
  const std::string& tip_words() const { return tip_words_; }
  bool on_stand() const { return stand_ != nullptr; }

  /// Opens the robot and looks at it (self-test); runtime_error says what is broken.
  std::unique_ptr<ManualDrive> open();
  /// From now on the robot is what this board file says.
  void change_board(const Board& board);

 private:
  std::string robot_;
  std::string board_path_;
  Board board_;
  StandSetup setup_;
  std::string tip_words_;
  std::unique_ptr<SimulatedStand> stand_;
  std::unique_ptr<GuardProcess> guard_;  // on the board; from the first open() on
};

}  // namespace equipoise::app
