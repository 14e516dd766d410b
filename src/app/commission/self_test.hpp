// Looks at a robot for a fifth of a second with its motors off. In: open backend -> out: empty, or what is
// wrong and where to look, one line. Start-up only.
#pragma once

#include <string>

#include "robot_io.h"

namespace equipoise::app {

std::string self_test(const rio_t& io);

}  // namespace equipoise::app
