// Files and texts that users name. Start-up only.
#pragma once

#include <string>

namespace equipoise::app {

/// A whole file; InputError names it.
std::string read_text(const std::string& path);

/// Why a result must not be written there as JSON; empty: it may. What holds something else is not
/// overwritten.
std::string json_output_error(const std::string& path);

/// For a terminal: control characters, which it would obey, as '?'.
std::string printable(const std::string& text);

}  // namespace equipoise::app
