// Any file is a run's log, whole ticks only, or an InputError.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "app/log/run_log.hpp"
#include "app/text/errors.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const std::string bytes(reinterpret_cast<const char*>(data), size);
    equipoise::app::RunLog log(bytes, "fuzz.lcm");
    for (equipoise::runtime::TickRecord tick; log.next(&tick);) {
      if (tick.compared >> log.estimators().size() != 0) std::abort();
    }
    if (log.damaged_bytes() > size) std::abort();
  } catch (const equipoise::app::InputError&) {
  }
  return 0;
}
