#include "app/text/version.hpp"

namespace equipoise::app {

std::string version() { return EQUIPOISE_VERSION; }

}  // namespace equipoise::app
