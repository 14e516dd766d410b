// Files and texts that users name. Start-up only.
#pragma once

#include <string>
#include <vector>

namespace equipoise::app {

/// Where a run's log goes when nobody says: logs/KIND-ROBOT-TIME.lcm, of a name that does not exist yet;
/// makes the folder.
std::string new_log_name(const std::string& kind, const std::string& robot);

/// A whole file; InputError names it.
std::string read_text(const std::string& path);

/// Why a result of a kind must not be written there; empty: it may. What begins like none of its kind is
/// somebody else's.
std::string output_error(const std::string& path, const std::vector<std::string>& beginnings,
                         const std::string& kind);
/// The same, thrown.
void check_output(const std::string& path, const std::vector<std::string>& beginnings,
                  const std::string& kind);

/// The same of JSON, which other kinds of files begin like: TOML with "[" (json.cpp).
std::string json_output_error(const std::string& path);
/// No file but a log is replaced by one.
void check_log(const std::string& path);

/// For a terminal: control characters, which it would obey, as '?'.
std::string printable(const std::string& text);

}  // namespace equipoise::app
