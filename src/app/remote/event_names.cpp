#include "app/remote/event_names.hpp"

#include <linux/input.h>

namespace equipoise::app {
namespace {

struct Known {
  const char* name;
  std::uint16_t code;
};

#define EQUIPOISE_CODE(name) \
  { #name, name }
constexpr Known kKnown[] = {
    EQUIPOISE_CODE(KEY_A),         EQUIPOISE_CODE(KEY_B),         EQUIPOISE_CODE(KEY_C),
    EQUIPOISE_CODE(KEY_D),         EQUIPOISE_CODE(KEY_E),         EQUIPOISE_CODE(KEY_F),
    EQUIPOISE_CODE(KEY_G),         EQUIPOISE_CODE(KEY_H),         EQUIPOISE_CODE(KEY_I),
    EQUIPOISE_CODE(KEY_J),         EQUIPOISE_CODE(KEY_K),         EQUIPOISE_CODE(KEY_L),
    EQUIPOISE_CODE(KEY_M),         EQUIPOISE_CODE(KEY_N),         EQUIPOISE_CODE(KEY_O),
    EQUIPOISE_CODE(KEY_P),         EQUIPOISE_CODE(KEY_Q),         EQUIPOISE_CODE(KEY_R),
    EQUIPOISE_CODE(KEY_S),         EQUIPOISE_CODE(KEY_T),         EQUIPOISE_CODE(KEY_U),
    EQUIPOISE_CODE(KEY_V),         EQUIPOISE_CODE(KEY_W),         EQUIPOISE_CODE(KEY_X),
    EQUIPOISE_CODE(KEY_Y),         EQUIPOISE_CODE(KEY_Z),         EQUIPOISE_CODE(KEY_UP),
    EQUIPOISE_CODE(KEY_DOWN),      EQUIPOISE_CODE(KEY_LEFT),      EQUIPOISE_CODE(KEY_RIGHT),
    EQUIPOISE_CODE(KEY_SPACE),     EQUIPOISE_CODE(KEY_ENTER),     EQUIPOISE_CODE(KEY_ESC),
    EQUIPOISE_CODE(KEY_TAB),       EQUIPOISE_CODE(KEY_BACKSPACE), EQUIPOISE_CODE(KEY_PAGEUP),
    EQUIPOISE_CODE(KEY_PAGEDOWN),  EQUIPOISE_CODE(KEY_HOME),      EQUIPOISE_CODE(KEY_END),
    EQUIPOISE_CODE(KEY_F1),        EQUIPOISE_CODE(KEY_F2),        EQUIPOISE_CODE(KEY_F3),
    EQUIPOISE_CODE(KEY_F4),        EQUIPOISE_CODE(BTN_TRIGGER),   EQUIPOISE_CODE(BTN_THUMB),
    EQUIPOISE_CODE(BTN_SOUTH),     EQUIPOISE_CODE(BTN_EAST),      EQUIPOISE_CODE(BTN_NORTH),
    EQUIPOISE_CODE(BTN_WEST),      EQUIPOISE_CODE(BTN_TL),        EQUIPOISE_CODE(BTN_TR),
    EQUIPOISE_CODE(BTN_TL2),       EQUIPOISE_CODE(BTN_TR2),       EQUIPOISE_CODE(BTN_SELECT),
    EQUIPOISE_CODE(BTN_START),     EQUIPOISE_CODE(BTN_MODE),      EQUIPOISE_CODE(BTN_THUMBL),
    EQUIPOISE_CODE(BTN_THUMBR),    EQUIPOISE_CODE(BTN_DPAD_UP),   EQUIPOISE_CODE(BTN_DPAD_DOWN),
    EQUIPOISE_CODE(BTN_DPAD_LEFT), EQUIPOISE_CODE(BTN_DPAD_RIGHT)};
constexpr Known kKnownAxes[] = {
    EQUIPOISE_CODE(ABS_X),     EQUIPOISE_CODE(ABS_Y),        EQUIPOISE_CODE(ABS_Z),
    EQUIPOISE_CODE(ABS_RX),    EQUIPOISE_CODE(ABS_RY),       EQUIPOISE_CODE(ABS_RZ),
    EQUIPOISE_CODE(ABS_GAS),   EQUIPOISE_CODE(ABS_BRAKE),    EQUIPOISE_CODE(ABS_HAT0X),
    EQUIPOISE_CODE(ABS_HAT0Y), EQUIPOISE_CODE(ABS_THROTTLE), EQUIPOISE_CODE(ABS_RUDDER)};
#undef EQUIPOISE_CODE

}  // namespace

std::optional<EventName> event_named(const std::string& name) {
  const bool negative = !name.empty() && name.front() == '-';
  const std::string plain = name.substr(negative ? 1 : 0);
  for (const Known& axis : kKnownAxes)
    if (plain == axis.name) return EventName{true, axis.code, negative ? -1.0 : 1.0};
  for (const Known& key : kKnown)
    if (!negative && plain == key.name) return EventName{false, key.code, 1.0};
  return std::nullopt;
}

}  // namespace equipoise::app
