// Command keys for the command line: what is wrong with a key file is bad input. Start-up only.
#pragma once

#include "app/cli/commands.hpp"
#include "equipoise/runtime/command_auth.hpp"

namespace equipoise::app {

inline runtime::CommandKey load_key(const std::string& path) {
  try {
    return runtime::CommandKey::load(path);
  } catch (const std::runtime_error& error) {
    throw InputError(error.what());
  }
}

inline void create_key(const std::string& path) {
  try {
    runtime::CommandKey::create(path);
  } catch (const std::runtime_error& error) {
    throw InputError(error.what());
  }
}

}  // namespace equipoise::app
