// A line of a GPIO chip as the board's configuration has it. In: chip's address, line -> out: bbb_pin_t.
#pragma once

#include <bbb_config.h>

#include <cstdint>
#include <cstdio>

inline bbb_pin_t pin_of(const char* chip, uint32_t line, bool active_low = false) {
  bbb_pin_t out{};
  out.used = true;
  std::snprintf(out.chip, sizeof out.chip, "%s", chip);
  out.line = line;
  out.active_low = active_low;
  return out;
}
