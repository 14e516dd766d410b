// Buttons and LED bars on the robot: whoever stands beside it has the last word. In: board file, presses, the
// command that was asked for -> out: the command that is allowed, LEDs. PAUSE disarms; pressed again it lets
// arm, once whoever commands has let go of arming. MODE cycles full, half, quarter speed. Bars: as many as
// the speed allows, blinking while paused. A thread of its own waits for presses; limit() is RT-safe. What
// cannot be opened is a warning, never a reason not to run.
#pragma once

#include <array>
#include <atomic>
#include <thread>
#include <vector>

#include "app/board/board.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/samples.hpp"
#include "gpio.h"
#include "led.h"

namespace equipoise::app {

/// What the buttons have chosen, applied to commands in the loop's thread.
class PanelGate {
 public:
  static constexpr std::array<double, 3> kShares{1.0, 0.5, 0.25};

  Command limit(const Command& asked, bool paused, std::size_t mode) noexcept {
    Command allowed = asked;
    allowed.velocity_W_m_s *= kShares[mode];
    allowed.yaw_rate_rad_s *= kShares[mode];
    if (paused) must_let_go_ = true;
    if (!paused && !asked.arm) must_let_go_ = false;
    if (must_let_go_) allowed.arm = false;
    return allowed;
  }

 private:
  bool must_let_go_ = false;  // nothing starts under a hand that has just let go of the button
};

class Panel : NoCopy {
 public:
  explicit Panel(const Board& board);
  ~Panel();  // LEDs dark

  Command limit(const Command& asked) noexcept {
    return gate_.limit(asked, paused_.load(std::memory_order_relaxed), mode_.load(std::memory_order_relaxed));
  }

  /// Bars lit of `count` in a given half second.
  static std::size_t bars_lit(std::size_t count, std::size_t mode, bool paused, bool odd) noexcept;

 private:
  void run();

  PanelGate gate_;
  std::array<gpio_line_t, 2> buttons_;  // PAUSE, MODE
  std::vector<led_t> bars_;
  std::atomic<bool> paused_{false};
  std::atomic<std::size_t> mode_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace equipoise::app
