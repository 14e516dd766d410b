// Any file is a run's log, whole ticks only, or an InputError.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "app/cli/commands.hpp"
#include "app/log/flight_log.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    const equipoise::app::FlightLog log = equipoise::app::parse_flight_log(bytes, "fuzz.lcm");
    if (log.damaged_bytes > size) std::abort();
    for (const equipoise::app::LoggedTick& tick : log.ticks) {
      if (tick.command.tick != tick.sensors.tick) std::abort();
    }
  } catch (const equipoise::app::InputError&) {
  }
  return 0;
}
