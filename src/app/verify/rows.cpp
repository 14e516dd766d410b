#include "app/verify/rows.hpp"

#include <cmath>

namespace equipoise::app {

double number_at(const nlohmann::json& row, const std::string& key) {
  if (!row.contains(key)) throw InputError(key + ": missing");
  if (!row[key].is_number()) throw InputError(key + ": expected a number");
  const double value = row[key].get<double>();
  if (!std::isfinite(value)) throw InputError(key + ": expected a finite number");
  return value;
}

std::vector<double> numbers_at(const nlohmann::json& row, const std::string& key, std::size_t count) {
  if (!row.contains(key)) throw InputError(key + ": missing");
  const nlohmann::json& array = row[key];
  const std::string expected = key + ": expected an array of " + std::to_string(count) + " numbers";
  if (!array.is_array() || array.size() != count) throw InputError(expected);
  std::vector<double> values;
  for (const nlohmann::json& element : array) {
    if (!element.is_number()) throw InputError(expected);
    values.push_back(element.get<double>());
  }
  return values;
}

}  // namespace equipoise::app
