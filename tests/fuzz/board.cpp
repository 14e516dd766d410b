// Any text is a board the drivers can be given, or a ConfigError.
#include "app/board/board.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "equipoise/config.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const equipoise::app::Board board =
        equipoise::app::parse_board(std::string(reinterpret_cast<const char*>(data), size), "fuzz.toml");
    const bbb_config_t& w = board.wiring;
    if (w.motors < 1 || w.motors > RIO_MAX_MOTORS || w.pwm_hz == 0 || w.battery_every_ticks == 0)
      std::abort();
    if (strnlen(w.imu.bus, sizeof w.imu.bus) == sizeof w.imu.bus) std::abort();
    if (strnlen(w.adc, sizeof w.adc) == sizeof w.adc) std::abort();
  } catch (const equipoise::ConfigError&) {
  }
  return 0;
}
