#include "app/run/status_indicator.hpp"

#include <cstdio>
#include <cstring>

namespace equipoise::app {
namespace {

std::optional<led_t> opened(const BoardLine& line, const char* name) {
  led_t led{};
  const gpio_pin_t pin = line.pin();
  const int status = led_open(&led, name, &pin);
  if (status == 0) return led;
  std::fprintf(stderr, "equipoise: warning: LED %s: %s\n", name, std::strerror(-status));
  return std::nullopt;
}

}  // namespace

StatusIndicator::StatusIndicator(const Board& board)
    : green_(opened(board.led_green, "green")), red_(opened(board.led_red, "red")) {
  if (const std::string& interface = board.can_interface; !interface.empty()) {
    const int status = can_open(&can_.emplace(), interface.c_str());
    if (status < 0) {
      can_.reset();
      std::fprintf(stderr, "equipoise: warning: no status on CAN: %s: %s\n", interface.c_str(),
                   std::strerror(-status));
    }
  }
  thread_ = std::thread([this] { run(); });
}

StatusIndicator::~StatusIndicator() {
  stop_.store(true);
  thread_.join();
  if (green_) led_close(&*green_);
  if (red_) led_close(&*red_);
  if (can_) can_close(&*can_);
}

StatusIndicator::Lights StatusIndicator::lights(ArmState state, std::uint32_t reasons,
                                                unsigned turn) noexcept {
  constexpr unsigned kTurnsPerBlink = 5;
  const bool odd = turn / kTurnsPerBlink % 2 == 1;
  const bool ready = (reasons & ~std::uint32_t{kNotRequested}) == 0;
  return {state == ArmState::kArmed || (ready && odd), state != ArmState::kArmed && !ready};
}

can_frame StatusIndicator::frame(std::uint64_t status) noexcept {
  can_frame frame{};
  frame.can_id = kStatusId;
  frame.can_dlc = CAN_MAX_DLEN;
  frame.data[0] = static_cast<std::uint8_t>(status >> 32U);
  frame.data[1] = static_cast<std::uint8_t>(status >> 40U);
  for (unsigned i = 0; i < 4; ++i) frame.data[2 + i] = static_cast<std::uint8_t>(status >> (8U * i));
  return frame;
}

void StatusIndicator::run() {
  Lights shown{};  // dark, as they were opened
  for (unsigned turn = 0; !stop_.load(); ++turn) {
    const std::uint64_t status = now_.load(std::memory_order_relaxed);
    const auto state = static_cast<ArmState>(static_cast<std::uint8_t>(status >> 32U));
    const Lights show = lights(state, static_cast<std::uint32_t>(status), turn);
    if (green_ && show.green != shown.green) (void)led_set(&*green_, show.green);
    if (red_ && show.red != shown.red) (void)led_set(&*red_, show.red);
    shown = show;
    if (can_) {
      const can_frame sent = frame(status);
      (void)can_send(&*can_, &sent);  // a bus without listeners must not disturb anybody
      can_frame ignored{};
      while (can_receive(&*can_, &ignored) == 0) {  // others' frames; error frames update the state
      }
    }
    std::this_thread::sleep_for(kTurn);
  }
}

}  // namespace equipoise::app
