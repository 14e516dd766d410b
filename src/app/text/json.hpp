// JSON values and files. The value type is compiled once (json.cpp), not in every file that builds one.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

extern template class nlohmann::basic_json<>;

namespace equipoise::app {

/// Reads a JSON file; InputError names it.
nlohmann::json read_json(const std::string& path);
/// Writes to a file, or to stdout where `path` is "-".
void write_json(const nlohmann::json& value, const std::string& path);

}  // namespace equipoise::app
