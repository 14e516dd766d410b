// Any text is a configuration or a ConfigError.
#include "equipoise/config.hpp"

#include <cstddef>
#include <cstdint>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    (void)equipoise::parse_mbbr(std::string(reinterpret_cast<const char*>(data), size), "fuzz.toml");
  } catch (const equipoise::ConfigError&) {
  }
  return 0;
}
