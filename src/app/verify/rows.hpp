// {"rows": [...]} in, {"rows": [...]} out: the shape of `model` and `bridge`.
#pragma once

#include "app/cli/commands.hpp"
#include "app/text/json.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

/// Applies `row` to every row of the file; errors name the file, the row and the key.
template <class RowFunction>
nlohmann::json map_rows(const std::string& path, RowFunction&& row) {
  const nlohmann::json in = read_json(path);
  if (!in.is_object() || !in.contains("rows") || !in["rows"].is_array()) {
    throw InputError(path + ": expected an object with an array \"rows\"");
  }
  nlohmann::json rows = nlohmann::json::array();
  std::size_t index = 0;
  for (const nlohmann::json& each : in["rows"]) {
    try {
      if (!each.is_object()) throw InputError("expected an object");
      rows.push_back(row(each));
    } catch (const InputError& error) {
      throw InputError(path + ": rows[" + std::to_string(index) + "]: " + error.what());
    }
    ++index;
  }
  return {{"rows", rows}};
}

double number_at(const nlohmann::json& row, const std::string& key);
std::vector<double> numbers_at(const nlohmann::json& row, const std::string& key, std::size_t count);

template <int N>
Vec<N> vector_at(const nlohmann::json& row, const std::string& key) {
  const std::vector<double> values = numbers_at(row, key, static_cast<std::size_t>(N));
  return Eigen::Map<const Vec<N>>(values.data());
}

template <int N>
nlohmann::json array_of(const Vec<N>& v) {
  return std::vector<double>(v.data(), v.data() + N);
}

}  // namespace equipoise::app
