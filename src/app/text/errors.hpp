// What the user did wrong, as an exception.
#pragma once

#include <stdexcept>

namespace equipoise::app {

/// Bad usage or input: exit code 2.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace equipoise::app
