#include "app/run/panel.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace equipoise::app {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(25);  // contacts bounce for less, fingers press for longer
constexpr unsigned kStablePolls = 2;
constexpr unsigned kPollsPerBlink = 20;

std::optional<button_t> opened(const BoardLine& line, bool active_low, const char* name) {
  button_t button{};
  const gpio_pin_t pin = line.pin(active_low);
  const int status = button_open(&button, &pin, kStablePolls);
  if (status == 0) return button;
  std::fprintf(stderr, "equipoise: warning: button %s: %s\n", name, std::strerror(-status));
  return std::nullopt;
}

bool was_pressed(std::optional<button_t>* button) {
  bool pressed = false;
  return *button && button_poll(&**button, &pressed) == 0 && pressed;
}

}  // namespace

Panel::Panel(const Board& board)
    : pause_(opened(board.button_pause, board.buttons_active_low, "PAUSE")),
      mode_button_(opened(board.button_mode, board.buttons_active_low, "MODE")) {
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
  if (pause_) button_close(&*pause_);
  if (mode_button_) button_close(&*mode_button_);
  for (led_t& bar : bars_) led_close(&bar);
}

std::size_t Panel::bars_lit(std::size_t count, std::size_t mode, bool paused, bool odd) noexcept {
  if (paused && !odd) return 0;
  return static_cast<std::size_t>(std::ceil(PanelGate::kShares[mode] * static_cast<double>(count)));
}

void Panel::run() {
  std::size_t shown = 0;
  for (unsigned turn = 0; !stop_.load(); ++turn) {
    if (was_pressed(&pause_)) paused_.store(!paused_.load(), std::memory_order_relaxed);
    if (was_pressed(&mode_button_))
      mode_.store((mode_.load() + 1) % PanelGate::kShares.size(), std::memory_order_relaxed);
    const std::size_t lit =
        bars_lit(bars_.size(), mode_.load(), paused_.load(), turn / kPollsPerBlink % 2 == 1);
    for (std::size_t i = 0; lit != shown && i < bars_.size(); ++i) (void)led_set(&bars_[i], i < lit);
    shown = lit;
    std::this_thread::sleep_for(kPoll);
  }
}

}  // namespace equipoise::app
