// Command keys for the command line: what is wrong with a key file is bad input. Start-up only.
#pragma once

#include "app/cli/commands.hpp"
#include "equipoise/runtime/command_key.hpp"

namespace equipoise::app {

/// f(), whose complaints are about the user's files and names.
template <class F>
auto as_input(F&& f) {
  try {
    return f();
  } catch (const std::runtime_error& error) {
    throw InputError(error.what());
  }
}

inline runtime::CommandKeys load_key(const std::string& path) {
  return as_input([&] { return runtime::CommandKeys::load(path); });
}

/// What a robot needs: keys from which those of every holder can be had.
inline runtime::CommandKeys load_robot_key(const std::string& path) {
  runtime::CommandKeys keys = load_key(path);
  if (!keys.holder().empty())
    throw InputError(path + ": is " + keys.holder() + "'s key; the robot needs its own");
  return keys;
}

}  // namespace equipoise::app
