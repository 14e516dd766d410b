// A world that does nothing by itself: it starts level.
#pragma once

#include "robots/mbbr/world.hpp"

namespace equipoise {

inline MbbrWorldParams level_world() {
  MbbrWorldParams w;
  w.common.initial_tilt_rad = 0.0;
  return w;
}

inline MbbrWorldParams level_world_without_friction() {
  MbbrWorldParams w = level_world();
  w.common.friction = false;
  return w;
}

}  // namespace equipoise
