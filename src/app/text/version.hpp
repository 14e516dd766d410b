// Version of this build. Out: text as --version says it.
#pragma once

#include <string>

namespace equipoise::app {

std::string version();

}  // namespace equipoise::app
