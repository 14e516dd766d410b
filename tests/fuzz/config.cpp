// Any text is a configuration of one robot, or a ConfigError.
#include "equipoise/config.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "robots/mbbr/config.hpp"
#include "robots/mip/config.hpp"

namespace {

template <class Parse>
bool readable(Parse&& parse, const std::string& text) {
  try {
    (void)parse(text, "fuzz.toml", {});
    return true;
  } catch (const equipoise::ConfigError&) {
    return false;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const bool ball = readable(equipoise::parse_mbbr, text);
  if (readable(equipoise::parse_mip, text) && ball) std::abort();
  return 0;
}
