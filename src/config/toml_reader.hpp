// Strict reading of a TOML file: every key must be known, present and within its range.
// Errors are ConfigError with file, line, key, and what is allowed. Start-up only.
#pragma once

#include <toml++/toml.h>

#include <set>
#include <string>
#include <vector>

#include "equipoise/config.hpp"
#include "equipoise/overrides.hpp"
#include "equipoise/types.hpp"

namespace equipoise::config {

/// Whole file with its overrides applied; knows where every value stands.
class Document {
 public:
  Document(const std::string& path, const Overrides& overrides);
  /// From text; `origin` takes the path's place in errors. `set`: as of --set.
  static Document parse(const std::string& text, const std::string& origin,
                        const std::vector<std::string>& set = {});

  const toml::table& root() const { return root_; }
  const std::string& path() const { return path_; }
  /// The effective configuration, and its SHA-256 in hex.
  std::string canonical() const;
  std::string sha256() const;
  /// What its sections have read.
  const std::vector<KeyFacts>& keys() const { return keys_; }

 private:
  friend class Section;
  explicit Document(std::string path) : path_(std::move(path)) {}

  std::string path_;
  toml::table root_;
  mutable std::vector<KeyFacts>
      keys_;  // sections read a document that does not change, and note what they read
};

/// One table; `finish` refuses keys that nobody asked for.
class Section {
 public:
  Section(const Document& document, const toml::table& table, std::string name)
      : document_(document), table_(table), name_(std::move(name)) {}

  Section table(const std::string& key);
  bool has(const std::string& key) const { return table_.contains(key); }
  bool is_text(const std::string& key) const { return table_[key].is_string(); }
  /// Array of tables.
  std::vector<Section> tables(const std::string& key, std::size_t min, std::size_t max);

  double number(const std::string& key, double min, double max);
  int integer(const std::string& key, int min, int max);
  bool boolean(const std::string& key);
  std::string text(const std::string& key);
  std::vector<std::string> texts(const std::string& key);
  /// A pair such as ["44e07000", 20].
  std::pair<std::string, int> text_and_integer(const std::string& key, int min, int max);
  /// An array of such pairs, at most `count`.
  std::vector<std::pair<std::string, int>> texts_and_integers(const std::string& key, std::size_t count,
                                                              int min, int max);
  /// Index of the value in `names`.
  std::size_t choice(const std::string& key, const std::vector<std::string>& names);
  std::vector<double> numbers(const std::string& key, std::size_t count, double min, double max);

  /// Rows of a rotation matrix.
  Mat3 rotation(const std::string& key);

  template <int N>
  Vec<N> vector(const std::string& key, double min, double max) {
    const std::vector<double> values = numbers(key, static_cast<std::size_t>(N), min, max);
    return Eigen::Map<const Vec<N>>(values.data());
  }

  void finish() const;
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

 private:
  const toml::node& node(const std::string& key);
  std::string string_value(const std::string& key, const std::string& allowed);
  /// The same for a value, which is noted.
  const toml::node& value_node(const std::string& key, const std::string& allowed);
  std::string full_name(const std::string& key) const { return name_.empty() ? key : name_ + "." + key; }
  std::pair<std::string, int> pair_of(const toml::node& node, const std::string& key, int min, int max) const;

  const Document& document_;
  const toml::table& table_;
  std::string name_;
  std::set<std::string> asked_;
};

/// For keys that may be absent, and those that logs of earlier builds lack.
inline double number_or(Section& s, const char* key, double otherwise, double min, double max) {
  return s.has(key) ? s.number(key, min, max) : otherwise;
}

}  // namespace equipoise::config
