// A board file (config/boards/*.toml): wiring for the drivers, and what of it the calibration has to know.
// In: path -> out: Board; ConfigError (file:line: key: reason and what is allowed) otherwise. Start-up only.
#pragma once

#include <string>
#include <vector>

#include "bbb_config.h"
#include "equipoise/overrides.hpp"
#include "gpio.h"

namespace equipoise::app {

struct BoardLine {
  std::string chip;
  int line = 0;
  gpio_pin_t pin(bool active_low = false) const {
    return {chip.c_str(), static_cast<unsigned>(line), active_low};
  }
};

struct Board {
  std::string robot;    // "mbbr" or "mip"
  std::string overlay;  // of the device tree: "cape", "blue"; "none": the board's own tree has it all
  bbb_config_t wiring{};
  BoardLine led_red, led_green;
  std::vector<BoardLine> led_bars;
  BoardLine button_pause, button_mode;
  bool buttons_active_low = true;
  std::string serial_device;  // address or path
  int serial_baud = 0;
  std::string can_interface;  // address or name; empty: no CAN
  int can_bitrate = 0;
  std::string calibration_file;  // of equipoise calibrate, beside the board file; empty: none
  BoardFacts facts;              // which the configuration must share
  MeasuredCalibration measured;  // what the calibration file says
};

/// For a configuration that is to run on this board.
Overrides overrides_of(const Board& board, std::vector<std::string> set = {});

/// What a robot that balances needs and this board's calibration file does not say; empty: nothing.
std::string missing_calibration(const Board& board);

Board load_board(const std::string& path);
/// Without reading its calibration file, which may still have to be made.
Board load_wiring(const std::string& path);
/// From text; `origin` names it in errors.
Board parse_board(const std::string& text, const std::string& origin);

}  // namespace equipoise::app
