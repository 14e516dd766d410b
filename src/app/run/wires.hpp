// Wires for commands by name: "udpm://..." (any LCM provider URL), "serial:DEVICE:BAUD" (the HC-06),
// "can:INTERFACE". In: name, side -> out: an open wire; InputError or runtime_error naming what is wrong.
#pragma once

#include <memory>
#include <string>

#include "equipoise/runtime/command_wire.hpp"

namespace equipoise::app {

inline constexpr const char* kWireHelp = "LCM provider URL, serial:DEVICE:BAUD or can:INTERFACE";

std::unique_ptr<runtime::CommandWire> open_wire(const std::string& name, runtime::WireSide side);

}  // namespace equipoise::app
