// Who commands, on stderr, from threads that must not wait for a terminal or a pipe that nobody reads.
#pragma once

#include <string>

namespace equipoise::app {

/// A line, or nothing where it would have to wait.
void journal(const std::string& what);

}  // namespace equipoise::app
