// Looks at a robot for a fifth of a second with its motors off. In: open backend -> out: empty, or what is
// wrong and where to look, one line. Start-up only.
#pragma once

#include <string>

#include "robot_io.h"

namespace equipoise::app {

inline constexpr int kMayMiss = 4;  // samples: the first after power-up, a late edge

std::string self_test(const rio_t& io);

}  // namespace equipoise::app
