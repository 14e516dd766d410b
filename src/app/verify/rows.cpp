#include "app/verify/rows.hpp"

#include <cmath>

namespace equipoise::app {

namespace {

nlohmann::json map_rows(const std::string& path, const Row& row) {
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

}  // namespace

void add_rows(const Subcommand& command, const std::string& in_help, const std::function<Row()>& row) {
  auto in = std::make_shared<std::string>();
  auto json = std::make_shared<std::string>("-");
  command.option("--in", *in, in_help).required();
  command.option("--json", *json, "output file, - for stdout").file().show_default();
  command.action([=] {
    write_json(map_rows(*in, row()), *json);
    return 0;
  });
}

double number_at(const nlohmann::json& row, const std::string& key) {
  if (!row.contains(key)) throw InputError(key + ": missing");
  if (!row[key].is_number()) throw InputError(key + ": expected a number");
  const double value = row[key].get<double>();
  if (!std::isfinite(value)) throw InputError(key + ": expected a finite number");
  return value;
}

bool flag_at(const nlohmann::json& row, const std::string& key) {
  if (!row.contains(key)) return false;
  if (!row[key].is_boolean()) throw InputError(key + ": expected true or false");
  return row[key].get<bool>();
}

Eigen::VectorXd numbers_at(const nlohmann::json& row, const std::string& key, Eigen::Index count) {
  if (!row.contains(key)) throw InputError(key + ": missing");
  const nlohmann::json& array = row[key];
  const std::string expected = key + ": expected an array of " + std::to_string(count) + " numbers";
  if (!array.is_array() || static_cast<Eigen::Index>(array.size()) != count) throw InputError(expected);
  Eigen::VectorXd values(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const nlohmann::json& element = array[static_cast<std::size_t>(i)];
    if (!element.is_number()) throw InputError(expected);
    values(i) = element.get<double>();
  }
  return values;
}

nlohmann::json array_of(const Eigen::VectorXd& v) {
  return std::vector<double>(v.data(), v.data() + v.size());
}

}  // namespace equipoise::app
