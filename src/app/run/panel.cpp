#include "app/run/panel.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {
namespace {

constexpr unsigned kStable_us = 10000;          // contacts bounce for less, fingers press for longer
constexpr std::int64_t kLook_ns = 100'000'000;  // so long an end may wait
constexpr std::int64_t kBlink_ns = 500'000'000;

gpio_line_t opened(const BoardLine& line, bool active_low, const char* name) {
  gpio_line_t button{};
  const gpio_pin_t pin = line.pin(active_low);
  if (const int status = gpio_open_press(&button, &pin, kStable_us); status < 0)
    std::fprintf(stderr, "equipoise: warning: button %s: %s\n", name, std::strerror(-status));
  return button;
}

}  // namespace

Panel::Panel(const Board& board)
    : buttons_{opened(board.button_pause, board.buttons_active_low, "PAUSE"),
               opened(board.button_mode, board.buttons_active_low, "MODE")} {
  constexpr std::array<const char*, 4> kNames{"bat25", "bat50", "bat75", "bat100"};  // the BeagleBone Blue's
  for (const BoardLine& line : board.led_bars) {
    led_t led{};
    const gpio_pin_t pin = line.pin();
    const char* const name = bars_.size() < kNames.size() ? kNames[bars_.size()] : nullptr;
    if (const int status = led_open(&led, name, &pin); status < 0) {
      std::fprintf(stderr, "equipoise: warning: LED bars: %s\n", std::strerror(-status));
      break;
    }
    bars_.push_back(led);
  }
  thread_ = std::thread([this] { run(); });
}

Panel::~Panel() {
  stop_.store(true);
  thread_.join();
  for (gpio_line_t& button : buttons_) gpio_close(&button);
  for (led_t& bar : bars_) led_close(&bar);
}

std::size_t Panel::bars_lit(std::size_t count, std::size_t mode, bool paused, bool odd) noexcept {
  if (paused && !odd) return 0;
  return static_cast<std::size_t>(std::ceil(PanelGate::kShares[mode] * static_cast<double>(count)));
}

void Panel::run() {
  std::size_t shown = 0;
  for (bool odd = false; !stop_.load(); odd = runtime::monotonic_now_ns() / kBlink_ns % 2 == 1) {
    const std::size_t lit = bars_lit(bars_.size(), mode_.load(), paused_.load(), odd);
    for (std::size_t i = 0; lit != shown && i < bars_.size(); ++i) (void)led_set(&bars_[i], i < lit);
    shown = lit;
    const std::int64_t next_look_ns = runtime::monotonic_now_ns() + kLook_ns;
    const int pressed = gpio_wait_presses(buttons_.data(), static_cast<int>(buttons_.size()), next_look_ns);
    if (pressed < 0) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(kLook_ns));
      continue;
    }
    if ((pressed & 1) != 0) paused_.store(!paused_.load(), std::memory_order_relaxed);
    if ((pressed & 2) != 0)
      mode_.store((mode_.load() + 1) % PanelGate::kShares.size(), std::memory_order_relaxed);
  }
}

}  // namespace equipoise::app
