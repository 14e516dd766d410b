#include "config/edits.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "config/nearest.hpp"
#include "equipoise/config.hpp"

namespace equipoise::config {
namespace {

// A dot may be a level of tables, which are read and freed by recursion; no file of ours has ten in a line.
// Those in strings and comments count, too: what is a string is for the parser to say.
constexpr int kMostDotsInALine = 100;
constexpr std::size_t kLongestKey = 200;

void refuse_deep_nesting(const std::string& text, const std::string& origin) {
  int line = 1;
  int dots = 0;
  for (const char c : text) {
    if (c == '\n') {
      ++line;
      dots = 0;
    } else if (c == '.' && ++dots > kMostDotsInALine) {
      throw ConfigError(origin + ":" + std::to_string(line) + ": more than " +
                        std::to_string(kMostDotsInALine) + " dots in a line");
    }
  }
}

/// At which names of files, and messages, would end.
void refuse_zero_characters(const toml::node& node, const std::string& where) {
  const auto refuse_in = [&](std::string_view text, const toml::node& holder) {
    if (text.find('\0') == std::string_view::npos) return;
    throw ConfigError((where.empty() ? "" : at(where, holder.source()) + ": ") +
                      "a text holds a zero character");
  };
  if (const auto* text = node.as_string()) refuse_in(text->get(), node);
  if (const auto* array = node.as_array()) {
    for (const toml::node& element : *array) refuse_zero_characters(element, where);
  }
  if (const auto* table = node.as_table()) {
    for (const auto& [key, value] : *table) {
      refuse_in(key.str(), value);
      refuse_zero_characters(value, where);
    }
  }
}

/// Replaces values of `root` by those of a fragment.
void merge(toml::table& root, toml::table&& fragment, const std::string& path, const std::string& where) {
  for (auto&& entry : fragment) {
    const toml::key& key = entry.first;
    toml::node& value = entry.second;
    const std::string name = where.empty() ? std::string(key.str()) : where + "." + std::string(key.str());
    if (!root.contains(key)) {
      throw ConfigError(at(path, value.source()) + ": " + name + ": no such key in the configuration");
    }
    if (value.is_table() && root.get(key)->is_table()) {
      merge(*root.get_as<toml::table>(key.str()), std::move(*value.as_table()), path, name);
    } else {  // moved nodes remember where they stood
      value.visit([&](auto& v) { root.insert_or_assign(key, std::move(v)); });
    }
  }
}

/// One edit of --set, with its errors.
class SetText {
 public:
  explicit SetText(const std::string& text) : text_(text) {}

  [[noreturn]] void fail(const std::string& what) const {
    constexpr std::size_t kShown = 120;
    throw ConfigError("--set " + (text_.size() > kShown ? text_.substr(0, kShown) + "..." : text_) + ": " +
                      what);
  }

  void apply(toml::table& root) const {
    const std::size_t equals = text_.find('=');
    if (equals == std::string::npos || equals == 0)
      fail("expected key=value, e.g. --set friction.compensation=0.8");
    if (equals > kLongestKey) fail("no key is as long");
    toml::table value = parsed_value(text_.substr(equals + 1));
    toml::node* at = &root;
    std::size_t begin = 0;
    const std::string path = text_.substr(0, equals);
    root_ = &root;
    for (bool last = false; !last;) {
      std::size_t end = path.find('.', begin);
      last = end == std::string::npos;
      if (last) end = path.size();
      at = step(at, path.substr(begin, end - begin), last ? value.get("value") : nullptr);
      begin = end + 1;
    }
  }

 private:
  /// {value = ...}; a bare word is a string.
  toml::table parsed_value(const std::string& value) const {
    if (value.find('\n') != std::string::npos) fail("a value is one line");
    try {
      return parsed_text("value = " + value, "");
    } catch (const ConfigError&) {
      try {
        return parsed_text("value = \"" + value + "\"", "");
      } catch (const ConfigError& error) {
        fail(error.what());
      }
    }
  }

  /// Along one part of the key, name[2][0]; the last part takes the value.
  toml::node* step(toml::node* node, const std::string& part, toml::node* value) const {
    const std::size_t bracket = std::min(part.find('['), part.size());
    const std::string name = trimmed(part.substr(0, bracket));
    toml::table* table = node->as_table();
    toml::node* found = table == nullptr ? nullptr : table->get(name);
    const bool new_include = name == "include" && value != nullptr && bracket == part.size();
    if (table == nullptr || (found == nullptr && !new_include)) fail_unknown();
    if (bracket == part.size()) {
      if (value != nullptr && !merged(value, found)) table->insert_or_assign(name, std::move(*value));
      return found;
    }
    if (found == nullptr) fail_unknown();
    for (std::size_t open = bracket; open < part.size();) {
      const std::size_t close = part.find(']', open);
      const std::string index = part.substr(open + 1, close == std::string::npos ? close : close - open - 1);
      toml::array* array = found->as_array();
      if (array == nullptr) fail(name + " is no array");
      if (part[open] != '[' || close == std::string::npos || index.empty() || index.size() > 6 ||
          index.find_first_not_of("0123456789") != std::string::npos)
        fail("expected an index such as " + name + "[0]");
      const std::size_t i = std::stoul(index);
      if (i >= array->size())
        fail(name + " has " + std::to_string(array->size()) + " elements, from [0] to [" +
             std::to_string(array->size() - 1) + "]");
      found = array->get(i);
      open = close + 1;
      if (open == part.size() && value != nullptr && !merged(value, found))
        array->replace(array->cbegin() + static_cast<std::ptrdiff_t>(i), std::move(*value));
    }
    return found;
  }

  /// A table's keys go into the table that stands there; anything else is to replace it.
  bool merged(toml::node* value, toml::node* present) const {
    if (present == nullptr || !present->is_table()) return false;
    if (!value->is_table()) fail("is a table; set one of its keys");
    if (value->as_table()->empty()) fail("sets nothing; name a key of the table");
    try {
      merge(*present->as_table(), std::move(*value->as_table()), "", "");
    } catch (const ConfigError&) {
      fail("no such key in the configuration");
    }
    return true;
  }

  static std::string trimmed(const std::string& text) {
    const std::size_t first = text.find_first_not_of(" \t");
    if (first == std::string::npos) return "";
    return text.substr(first, text.find_last_not_of(" \t") - first + 1);
  }

  [[noreturn]] void fail_unknown() const {
    std::string asked = text_.substr(0, text_.find('='));
    const std::size_t bracket = asked.find('[');
    if (bracket != std::string::npos) asked.resize(bracket);
    std::vector<std::string> known;
    keys_of(*root_, "", &known);
    std::string hint = did_you_mean(asked, known);
    for (std::size_t i = 0; i < known.size() && hint.empty(); ++i) {  // of a table that was left out
      const std::string& key = known[i];
      const std::size_t dot = key.rfind('.');
      if (dot != std::string::npos && key.compare(dot + 1, std::string::npos, asked) == 0)
        hint = "; did you mean " + key + "?";
    }
    fail("no such key in the configuration" + hint);
  }

  static void keys_of(const toml::table& table, const std::string& where, std::vector<std::string>* keys) {
    for (const auto& [key, value] : table) {
      const std::string name = (where.empty() ? "" : where + ".") + std::string(key.str());
      keys->push_back(name);
      if (value.is_table()) keys_of(*value.as_table(), name, keys);
    }
  }

  const std::string& text_;
  mutable const toml::table* root_ = nullptr;  // while applying
};

bool differs(double a, double b) { return !(std::abs(a - b) <= 1e-6 * std::max(std::abs(a), std::abs(b))); }

}  // namespace

std::string shortest(double value, int digits) {
  std::ostringstream text;
  text.precision(digits);
  text << value;
  return text.str();
}

std::string at(const std::string& path, const toml::source_region& where) {
  if (where.begin.line == 0) return path;
  return (where.path ? *where.path : path) + ":" + std::to_string(where.begin.line);
}

toml::table parsed_text(const std::string& text, const std::string& origin) {
  refuse_deep_nesting(text, origin);
  try {
    toml::table table = toml::parse(text, origin);
    refuse_zero_characters(table, origin);
    return table;
  } catch (const toml::parse_error& error) {
    const std::string where = origin.empty() ? "" : at(origin, error.source()) + ": ";
    throw ConfigError(where + std::string(error.description()));
  }
}

toml::table parsed_file(const std::string& path, const std::string& hint) {
  std::error_code ignored;
  const auto status = std::filesystem::status(path, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw ConfigError(path + ": is no regular file");
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || (file.peek() != std::ifstream::traits_type::eof() && !(text << file.rdbuf())))
    throw ConfigError(path + ": cannot be opened" + hint);
  return parsed_text(text.str(), path);
}

void apply_base(toml::table& root, const std::string& path) {
  constexpr int kMostBases = 8;  // a file may be its own by mistake
  toml::table edits = std::move(root);
  std::string file = path;
  std::vector<std::pair<std::string, toml::table>> layers;
  while (edits.contains("base")) {
    const auto name = edits["base"].value_exact<std::string>();
    if (!name) throw ConfigError(file + ": base: expected the name of a file");
    if (layers.size() == kMostBases) throw ConfigError(path + ": base: more than 8 in a chain");
    edits.erase("base");
    const std::string beside = file.substr(0, file.rfind('/') + 1);
    layers.emplace_back(file, std::move(edits));
    file = name->rfind('/', 0) == 0 ? *name : beside + *name;
    edits = parsed_file(file, "; it is the base of " + layers.back().first);
  }
  for (; !layers.empty(); layers.pop_back())
    merge(edits, std::move(layers.back().second), layers.back().first, "");
  root = std::move(edits);
}

void apply_includes(toml::table& root, const std::string& path) {
  const toml::node* include = root.get("include");
  if (include == nullptr) return;
  const toml::array* files = include->as_array();
  if (files == nullptr || (!files->empty() && !files->is_homogeneous<std::string>())) {
    throw ConfigError(path + ": include: expected an array of file names, e.g. include = [\"motor.toml\"]");
  }
  const std::string folder = path.substr(0, path.rfind('/') + 1);
  std::vector<std::string> names;
  for (const toml::node& node : *files) names.push_back(node.as_string()->get());
  root.erase("include");
  for (const std::string& name : names) {
    const std::string fragment = name.rfind('/', 0) == 0 ? name : folder + name;
    try {
      merge(root, parsed_file(fragment, ""), fragment, "");
    } catch (const ConfigError& error) {
      const bool of_the_file = std::string(error.what()).rfind(fragment + ": ", 0) == 0;
      throw ConfigError((of_the_file ? path + ": include: " : "") + error.what());
    }
  }
}

void check_board(const toml::table& root, const std::string& path, const BoardFacts& board) {
  constexpr int kDigits = 10;  // show what differs
  const auto complain = [&](const std::string& key, const std::string& board_value,
                            const std::string& ours_key, const toml::node& ours, const std::string& value) {
    throw ConfigError(board.file + ": " + key + ": " + board_value + " where " + at(path, ours.source()) +
                      " has " + ours_key + " = " + value + "; both must say the same");
  };
  const auto number = [&](const std::string& key, double theirs, const std::string& ours_key) {
    const toml::node* node = toml::at_path(root, ours_key).node();
    if (node == nullptr) return;
    const auto ours = node->value<double>();
    if (ours && differs(theirs, *ours))
      complain(key, shortest(theirs, kDigits), ours_key, *node, shortest(*ours, kDigits));
  };
  number("bridges.pwm_hz", board.pwm_hz, "motor.pwm_hz");
  number("battery.V_per_count", board.battery_V_per_count, "calibration.battery_V_per_count");
  number("battery.offset_V", board.battery_offset_V, "calibration.battery_offset_V");
  for (std::size_t i = 0; i < board.R_BS.size(); ++i) {
    const std::string index = "[" + std::to_string(i) + "]";
    number("imu.R_BS" + index, board.R_BS[i], "calibration.R_BS" + index);
  }
  number("imu.low_pass delays the gyro", board.gyro_delay_s, "chain.gyro_delay_s");
  number("imu.low_pass delays the accelerometer", board.accel_delay_s, "chain.accel_delay_s");
  const toml::node* bridge = toml::at_path(root, "motor.bridge").node();
  if (bridge == nullptr) return;
  const auto ours = bridge->value<std::string>();
  if (ours && *ours != board.bridge)
    complain("motor.bridge", "wired as " + board.bridge, "motor.bridge", *bridge, *ours);
}

void apply_measured(toml::table& root, const MeasuredCalibration& measured) {
  toml::table* calibration = root["calibration"].as_table();
  if (calibration == nullptr) return;  // reading it will say so
  const auto put = [&](const char* key, const auto& values) {
    if (!values) return;
    toml::array array;
    for (const double value : *values) array.push_back(value);
    calibration->insert_or_assign(key, std::move(array));
  };
  put("R_BS", measured.R_BS);
  put("gyro_bias_rad_s", measured.gyro_bias_B_rad_s);
  put("accel_scale", measured.accel_scale_S);
  put("accel_bias_m_s2", measured.accel_bias_B_m_s2);
}

void apply_set(toml::table& root, const std::string& text) { SetText(text).apply(root); }

}  // namespace equipoise::config
