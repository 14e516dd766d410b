// Edits of a parsed configuration: included fragments, a board's facts and measurements, --set. In: table,
// edit -> out: the table changed; ConfigError names the edit and what is wrong. A key that the configuration
// lacks is always a mistake. Start-up only.
#pragma once

#include <toml++/toml.h>

#include <string>

#include "equipoise/overrides.hpp"

namespace equipoise::config {

/// A number in at most so many digits.
std::string shortest(double value, int digits = 6);

/// "file:line", or "file" where a value has no line.
std::string at(const std::string& path, const toml::source_region& where);

/// A file's text as a table. Refuses what is no regular file (a pipe would be waited for), and what is nested
/// so deep that reading it could exhaust the stack.
toml::table parsed_file(const std::string& path, const std::string& hint);
toml::table parsed_text(const std::string& text, const std::string& origin);

/// `base = "robot.toml"`: what this file does not say is as that one has it, which may have a base, too.
void apply_base(toml::table& root, const std::string& path);
/// `include = ["fragment.toml"]`: files beside the configuration whose values replace its own, in order.
void apply_includes(toml::table& root, const std::string& path);
/// ConfigError where configuration and board file contradict each other.
void check_board(const toml::table& root, const std::string& path, const BoardFacts& board);
void apply_measured(toml::table& root, const MeasuredCalibration& measured);
/// key=value; a key is a.b.c, an element of an array a.b[2] or a.b[2].c.
void apply_set(toml::table& root, const std::string& text);

}  // namespace equipoise::config
