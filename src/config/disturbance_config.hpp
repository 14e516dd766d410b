// Reads [world.full.disturbance]: what a real MBBR does and its model leaves out.
// In: section -> out: parameters; ConfigError otherwise. Start-up only.
#pragma once

#include "toml_reader.hpp"

namespace equipoise::config {

MbbrDisturbanceParams read_disturbance(Section s);

}  // namespace equipoise::config
