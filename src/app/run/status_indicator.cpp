#include "app/run/status_indicator.hpp"

#include <cstdio>
#include <cstring>

namespace equipoise::app {
namespace {

bool open_led(led_t* led, const BoardLine& line, const char* name) {
  gpio_pin_t pin{};
  pin.chip = line.chip.c_str();
  pin.offset = static_cast<unsigned>(line.line);
  const int status = led_open(led, name, &pin);
  if (status < 0) std::fprintf(stderr, "equipoise: warning: LED %s: %s\n", name, std::strerror(-status));
  return status == 0;
}

}  // namespace

StatusIndicator::StatusIndicator(const Board& board) {
  has_green_ = open_led(&green_, board.led_green, "green");
  has_red_ = open_led(&red_, board.led_red, "red");
  if (!board.can_interface.empty()) {
    const int status = can_open(&can_, board.can_interface.c_str());
    has_can_ = status == 0;
    if (!has_can_)
      std::fprintf(stderr, "equipoise: warning: no status on CAN: %s: %s\n", board.can_interface.c_str(),
                   std::strerror(-status));
  }
  thread_ = std::thread([this] { run(); });
}

StatusIndicator::~StatusIndicator() {
  stop_.store(true);
  thread_.join();
  if (has_green_) led_close(&green_);
  if (has_red_) led_close(&red_);
  if (has_can_) can_close(&can_);
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
  for (unsigned turn = 0; !stop_.load(); ++turn) {
    const std::uint64_t status = now_.load(std::memory_order_relaxed);
    const auto state = static_cast<ArmState>(static_cast<std::uint8_t>(status >> 32U));
    const Lights show = lights(state, static_cast<std::uint32_t>(status), turn);
    if (has_green_) (void)led_set(&green_, show.green);
    if (has_red_) (void)led_set(&red_, show.red);
    if (has_can_) {
      const can_frame sent = frame(status);
      (void)can_send(&can_, &sent);  // a bus without listeners must not disturb anybody
      can_frame ignored{};
      while (can_receive(&can_, &ignored) == 0) {  // others' frames; error frames update the state
      }
    }
    std::this_thread::sleep_for(kTurn);
  }
}

}  // namespace equipoise::app
