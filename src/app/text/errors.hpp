// What the user did wrong, as an exception.
#pragma once

#include "equipoise/config.hpp"

namespace equipoise::app {

/// Bad usage or input, exit code 2, as a wrong configuration is.
struct InputError : ConfigError {
  using ConfigError::ConfigError;
};

}  // namespace equipoise::app
