// Says on LEDs and on CAN whether the motors may run, and why not. In: arm state, reasons, battery, once per
// tick -> out: green LED: steady while armed, blinking while only asked-for is missing; red LED: another
// reason forbids; CAN frame 0x1E0 ten times a second: arm state, battery in 0.1 V, reasons (4 bytes, low
// first), 2 bytes 0. From a thread of its own; tell() is RT-safe: one atomic store. What cannot be opened is
// a warning, never a reason not to run.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <thread>

#include "app/board/board.hpp"
#include "can.h"
#include "equipoise/actuate/safety.hpp"
#include "equipoise/no_copy.hpp"
#include "led.h"

namespace equipoise::app {

class StatusIndicator : NoCopy {
 public:
  static constexpr std::uint32_t kStatusId = 0x1E0;

  explicit StatusIndicator(const Board& board);
  ~StatusIndicator();  // LEDs dark

  void tell(ArmState state, std::uint32_t reasons, double battery_V) noexcept {
    const double tenths = battery_V > 0.0 && battery_V < 25.5 ? 10.0 * battery_V : 0.0;
    now_.store(std::uint64_t{reasons} | std::uint64_t{static_cast<std::uint8_t>(state)} << 32U |
                   std::uint64_t{static_cast<std::uint8_t>(tenths)} << 40U,
               std::memory_order_relaxed);
  }

  /// What the LEDs show in a turn of 100 ms: ready is a blink a second.
  struct Lights {
    bool green;
    bool red;
  };
  static constexpr std::chrono::milliseconds kTurn{100};
  static Lights lights(ArmState state, std::uint32_t reasons, unsigned turn) noexcept;
  static can_frame frame(std::uint64_t status) noexcept;

 private:
  void run();

  std::optional<led_t> green_, red_;
  std::optional<can_port_t> can_;
  std::atomic<std::uint64_t> now_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace equipoise::app
