#include "config/toml_reader.hpp"

#include <sodium.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "config/edits.hpp"
#include "config/nearest.hpp"

namespace equipoise::config {
namespace {

std::string range(double min, double max) { return shortest(min) + " to " + shortest(max); }

}  // namespace

Document::Document(const std::string& path, const Overrides& overrides)
    : path_(path), root_(parsed_file(path, "; give a configuration with --config FILE")) {
  apply_base(root_, path);
  // An include given with --set comes before the other overrides, so that these have the last word.
  const auto includes = [](const std::string& text) { return text.rfind("include=", 0) == 0; };
  for (const std::string& text : overrides.set) {
    if (includes(text)) apply_set(root_, text);
  }
  apply_includes(root_, path);
  if (overrides.board) check_board(root_, path, *overrides.board);
  apply_measured(root_, overrides.measured);
  for (const std::string& text : overrides.set) {
    if (!includes(text)) apply_set(root_, text);
  }
}

Document Document::parse(const std::string& text, const std::string& origin,
                         const std::vector<std::string>& set) {
  Document document(origin);
  document.root_ = parsed_text(text, origin);
  for (const std::string& edit : set) apply_set(document.root_, edit);
  return document;
}

std::string Document::canonical() const {
  std::ostringstream text;
  text << root_;  // keys are sorted in a toml::table
  return text.str();
}

std::string Document::sha256() const {
  if (sodium_init() < 0) throw ConfigError("libsodium could not be initialised");
  const std::string bytes = canonical();
  std::array<unsigned char, crypto_hash_sha256_BYTES> digest{};
  crypto_hash_sha256(digest.data(), reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  std::array<char, 2 * crypto_hash_sha256_BYTES + 1> hex{};
  sodium_bin2hex(hex.data(), hex.size(), digest.data(), digest.size());
  return hex.data();
}

void Section::fail(const std::string& key, const std::string& what) const {
  const toml::node* found = table_.get(key);
  const std::string where = at(document_.path(), found != nullptr ? found->source() : table_.source());
  throw ConfigError(where + ": " + full_name(key) + ": " + what);
}

const toml::node& Section::node(const std::string& key) {
  asked_.insert(key);
  const toml::node* found = table_.get(key);
  if (found == nullptr) fail(key, "missing");
  return *found;
}

const toml::node& Section::value_node(const std::string& key, const std::string& allowed) {
  const toml::node& found = node(key);
  std::ostringstream value;
  found.visit([&value](const auto& v) { value << v; });
  const toml::source_region& source = found.source();
  document_.keys_.push_back({full_name(key), value.str(), source.path ? *source.path : "",
                             static_cast<int>(source.begin.line), allowed});
  return found;
}

Section Section::table(const std::string& key) {
  const toml::table* found = node(key).as_table();
  if (found == nullptr) fail(key, "expected a table");
  return Section(document_, *found, full_name(key));
}

std::vector<Section> Section::tables(const std::string& key, std::size_t min, std::size_t max) {
  const toml::array* array = node(key).as_array();
  if (array == nullptr || (!array->empty() && !array->is_array_of_tables()))
    fail(key, "expected an array of tables");
  if (array->size() < min || array->size() > max) {
    fail(key, std::to_string(array->size()) + " entries; allowed: " + std::to_string(min) + " to " +
                  std::to_string(max));
  }
  std::vector<Section> sections;
  sections.reserve(array->size());
  for (std::size_t i = 0; i < array->size(); ++i) {
    sections.emplace_back(document_, *array->get_as<toml::table>(i),
                          full_name(key) + "[" + std::to_string(i) + "]");
  }
  return sections;
}

double Section::number(const std::string& key, double min, double max) {
  const auto value = value_node(key, range(min, max)).value<double>();
  if (!value) fail(key, "expected a number");
  if (!std::isfinite(*value) || *value < min || *value > max)
    fail(key, shortest(*value) + " is out of range; allowed: " + range(min, max));
  return *value;
}

int Section::integer(const std::string& key, int min, int max) {
  const auto value = value_node(key, "whole numbers, " + range(min, max)).value_exact<std::int64_t>();
  if (!value) fail(key, "expected a whole number");
  if (*value < min || *value > max)
    fail(key, std::to_string(*value) + " is out of range; allowed: " + range(min, max));
  return static_cast<int>(*value);
}

bool Section::boolean(const std::string& key) {
  const auto value = value_node(key, "true or false").value_exact<bool>();
  if (!value) fail(key, "expected true or false");
  return *value;
}

std::string Section::text(const std::string& key) { return string_value(key, "a string"); }

std::vector<std::string> Section::texts(const std::string& key) {
  const toml::array* array = value_node(key, "an array of strings").as_array();
  if (array == nullptr || !array->is_homogeneous<std::string>()) fail(key, "expected an array of strings");
  std::vector<std::string> out;
  for (const toml::node& element : *array) out.push_back(element.as_string()->get());
  return out;
}

std::string Section::string_value(const std::string& key, const std::string& allowed) {
  const auto value = value_node(key, allowed).value_exact<std::string>();
  if (!value) fail(key, "expected a string");
  return *value;
}

std::pair<std::string, int> Section::pair_of(const toml::node& node, const std::string& key, int min,
                                             int max) const {
  const toml::array* pair = node.as_array();
  if (pair == nullptr || pair->size() != 2) fail(key, "expected a pair of a string and a whole number");
  const auto text = pair->get(0)->value_exact<std::string>();
  const auto number = pair->get(1)->value_exact<std::int64_t>();
  if (!text || !number) fail(key, "expected a pair of a string and a whole number");
  if (*number < min || *number > max)
    fail(key, std::to_string(*number) + " is out of range; allowed: " + range(min, max));
  return {*text, static_cast<int>(*number)};
}

std::pair<std::string, int> Section::text_and_integer(const std::string& key, int min, int max) {
  return pair_of(node(key), key, min, max);
}

std::vector<std::pair<std::string, int>> Section::texts_and_integers(const std::string& key,
                                                                     std::size_t count, int min, int max) {
  const toml::array* array = node(key).as_array();
  if (array == nullptr || array->size() > count)
    fail(key, "expected an array of at most " + std::to_string(count) + " pairs");
  std::vector<std::pair<std::string, int>> pairs;
  for (const toml::node& element : *array) pairs.push_back(pair_of(element, key, min, max));
  return pairs;
}

std::size_t Section::choice(const std::string& key, const std::vector<std::string>& names) {
  std::string allowed;
  for (const std::string& name : names) allowed += (allowed.empty() ? "" : ", ") + name;
  const std::string value = string_value(key, allowed);
  const auto found = std::find(names.begin(), names.end(), value);
  if (found == names.end()) fail(key, "\"" + value + "\" is not known; allowed: " + allowed);
  return static_cast<std::size_t>(found - names.begin());
}

std::vector<double> Section::numbers(const std::string& key, std::size_t count, double min, double max) {
  const toml::array* array =
      value_node(key, std::to_string(count) + " numbers, each " + range(min, max)).as_array();
  if (array == nullptr || array->size() != count)
    fail(key, "expected an array of " + std::to_string(count) + " numbers");
  std::vector<double> values;
  for (const toml::node& element : *array) {
    const auto value = element.value<double>();
    if (!value) fail(key, "expected an array of " + std::to_string(count) + " numbers");
    if (!std::isfinite(*value) || *value < min || *value > max) {
      fail(key, shortest(*value) + " is out of range; allowed: " + range(min, max));
    }
    values.push_back(*value);
  }
  return values;
}

Mat3 Section::rotation(const std::string& key) {
  const std::vector<double> rows = numbers(key, 9, -1.0, 1.0);
  Mat3 R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
  if (!((R * R.transpose() - Mat3::Identity()).norm() <= 1e-6) || R.determinant() < 0.0)
    fail(key, "is not a rotation matrix (rows, sensor axes to body axes)");
  return R;
}

void Section::finish() const {
  for (const auto& [key, value] : table_) {
    const std::string name(key.str());
    if (asked_.count(name) != 0) continue;
    std::string message = at(document_.path(), value.source());
    message += ": ";
    if (!name_.empty()) message += name_ + ".";
    message += name;
    message += ": unknown key";
    throw ConfigError(message + did_you_mean(name, {asked_.begin(), asked_.end()}));
  }
}

}  // namespace equipoise::config
