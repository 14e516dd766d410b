// Keys, buttons and axes by the kernel's names (linux/input-event-codes.h). In: "KEY_W", "BTN_START",
// "-ABS_Y" -> out: what it is; nothing for a name that is none of these.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace equipoise::app {

struct EventName {
  bool axis = false;
  std::uint16_t code = 0;
  double sign = 1.0;
};

std::optional<EventName> event_named(const std::string& name);

}  // namespace equipoise::app
