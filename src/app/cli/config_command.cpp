// equipoise config: what a configuration says, how two differ, and what a key means: its value, unit and
// range, where it stands, and the source given there.
#include <array>
#include <cstdio>
#include <fstream>
#include <map>

#include "app/cli/commands.hpp"
#include "app/text/json.hpp"
#include "app/trial/firmware.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string config;
  std::string key;
  std::string other;
  std::vector<std::string> set;
  std::string json;
};

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// Of a key by its ending; the longest that fits stands first.
std::string unit_of(const std::string& key) {
  static constexpr std::array<std::array<const char*, 2>, 27> kUnits{{
      {"_counts_per_deg_s", "counts per deg/s"},
      {"_counts_per_rev", "counts per revolution"},
      {"_counts_per_g", "counts per g"},
      {"_V_per_count", "V per count"},
      {"_kg_m2", "kg m^2"},
      {"_kg_m2_s", "kg m^2/s"},
      {"_kg", "kg"},
      {"_N_m_s", "N m s"},
      {"_N_m_A", "N m/A"},
      {"_N_m", "N m"},
      {"_N", "N"},
      {"_rad_s2", "rad/s^2"},
      {"_rad_s", "rad/s"},
      {"_rad", "rad"},
      {"_m_s3", "m/s^3"},
      {"_m_s2", "m/s^2"},
      {"_m_s", "m/s"},
      {"_deg_s", "deg/s"},
      {"_deg", "deg"},
      {"_dB", "dB"},
      {"_hz", "Hz"},
      {"_ohm", "ohm"},
      {"_ticks", "ticks of 5 ms"},
      {"_H", "H"},
      {"_V", "V"},
      {"_s", "s"},
      {"_m", "m"},
  }};
  const std::string name = key.substr(0, key.find('['));
  for (const auto& [end, unit] : kUnits) {
    if (ends_with(name, end)) return unit;
  }
  return "";
}

std::string trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// What the file says beside a key: its line's comment, or else the lines of comment right above.
std::string comment_at(const KeyFacts& facts) {
  std::ifstream file(facts.file);
  std::string above;
  std::string line;
  for (int i = 1; i <= facts.line && std::getline(file, line); ++i) {
    const std::size_t hash = line.find('#');
    if (i == facts.line) return hash == std::string::npos ? above : trimmed(line.substr(hash + 1));
    if (trimmed(line.substr(0, hash)).empty() && hash != std::string::npos)
      above += (above.empty() ? "" : " ") + trimmed(line.substr(hash + 1));
    else
      above.clear();
  }
  return "";
}

std::string place_of(const KeyFacts& facts) {
  return facts.file.empty() ? "--set" : facts.file + ":" + std::to_string(facts.line);
}

/// The value, or its TOML where that is no JSON.
nlohmann::json value_of(const KeyFacts& facts) {
  nlohmann::json value = nlohmann::json::parse(facts.value, nullptr, false);
  if (!value.is_discarded()) return value;
  const bool quoted = facts.value.size() >= 2 && facts.value.front() == '\'' && facts.value.back() == '\'';
  return quoted ? facts.value.substr(1, facts.value.size() - 2) : facts.value;
}

std::string text_of(const KeyFacts& facts) { return value_of(facts).dump(); }

nlohmann::json text_or_null(const std::string& text) {
  return text.empty() ? nlohmann::json(nullptr) : nlohmann::json(text);
}

nlohmann::json explained(const KeyFacts& facts) {
  return {{"key", facts.key},
          {"value", value_of(facts)},
          {"unit", text_or_null(unit_of(facts.key))},
          {"allowed", text_or_null(facts.allowed)},
          {"where", place_of(facts)},
          {"source", text_or_null(comment_at(facts))}};
}

void print_explained(const KeyFacts& facts) {
  const auto row = [](const char* name, const std::string& text) {
    if (!text.empty()) std::printf("  %-8s %s\n", name, text.c_str());
  };
  std::printf("%s = %s\n", facts.key.c_str(), text_of(facts).c_str());
  row("unit", unit_of(facts.key));
  row("allowed", facts.allowed);
  row("where", place_of(facts));
  row("source", comment_at(facts));
}

int explain(const Arguments& a) {
  const auto robot = load_robot(a.config, a.set);
  nlohmann::json rows = nlohmann::json::array();
  std::vector<std::string> alike;
  for (const KeyFacts& facts : robot->keys) {
    const bool below =
        facts.key.rfind(a.key, 0) == 0 && (facts.key[a.key.size()] == '.' || facts.key[a.key.size()] == '[');
    if (facts.key != a.key && !below) {
      if (facts.key.find(a.key) != std::string::npos) alike.push_back(facts.key);
      continue;
    }
    rows.push_back(explained(facts));
    if (a.json.empty()) print_explained(facts);
  }
  if (rows.empty()) {
    std::string hint;
    for (const std::string& key : alike) hint += (hint.empty() ? "; there is " : ", ") + key;
    throw InputError(a.config + ": " + a.key + ": no such key" + hint);
  }
  if (!a.json.empty()) write_json({{"keys", rows}}, a.json);
  return 0;
}

int show(const Arguments& a) {
  const auto robot = load_robot(a.config, a.set);
  if (a.json.empty()) {
    std::printf("%s\n", robot->toml.c_str());
    return 0;
  }
  nlohmann::json values = nlohmann::json::object();
  for (const KeyFacts& facts : robot->keys) values[facts.key] = value_of(facts);
  write_json(values, a.json);
  return 0;
}

int diff(const Arguments& a) {
  const bool itself = a.other.empty();
  if (itself && a.set.empty()) throw InputError("config diff: name a second file, or what to --set");
  std::map<std::string, std::array<const KeyFacts*, 2>> keys;
  const std::array sides{load_robot(a.config, {}), load_robot(itself ? a.config : a.other, a.set)};
  for (std::size_t i = 0; i < sides.size(); ++i) {
    for (const KeyFacts& facts : sides[i]->keys) keys[facts.key][i] = &facts;
  }
  nlohmann::json rows = nlohmann::json::object();
  for (const auto& [key, facts] : keys) {
    if (facts[0] != nullptr && facts[1] != nullptr && facts[0]->value == facts[1]->value) continue;
    nlohmann::json row = nlohmann::json::array();
    std::array<std::string, 2> texts;
    for (std::size_t i = 0; i < facts.size(); ++i) {
      row.push_back(facts[i] == nullptr ? nlohmann::json(nullptr) : value_of(*facts[i]));
      texts[i] = facts[i] == nullptr ? "(absent)" : text_of(*facts[i]);
    }
    if (a.json.empty()) std::printf("%s: %s -> %s\n", key.c_str(), texts[0].c_str(), texts[1].c_str());
    rows[key] = row;
  }
  if (a.json.empty() && rows.empty()) std::printf("no difference\n");
  if (!a.json.empty()) write_json(rows, a.json);
  return 0;
}

}  // namespace

void add_config(Subcommand app) {
  const Subcommand command =
      app.subcommand("config", "What a configuration says, and what its keys mean")
          .example("equipoise config explain friction.compensation --config config/mbbr.toml");
  command.require_subcommand();
  const auto a = std::make_shared<Arguments>();
  const auto common = [&a](const Subcommand& part) {
    part.option("--set", a->set, "override a configuration key, e.g. --set friction.compensation=0.8");
    part.option("--json", a->json, "output file, - for stdout").file();
  };

  const Subcommand of_show =
      command.subcommand("show", "The configuration in force: includes and --set applied")
          .example("equipoise config show --config config/mbbr.toml");
  of_show.option("--config", a->config, "robot configuration, TOML").file().required();
  common(of_show);
  of_show.action([a] { return show(*a); });

  const Subcommand of_diff = command.subcommand("diff", "Keys in which two configurations differ")
                                 .example("equipoise config diff config/mbbr.toml config/kugle.toml");
  of_diff.option("file", a->config, "robot configuration, TOML").file().required();
  of_diff.option("other", a->other, "the second; without it the first with --set applied").file();
  common(of_diff);
  of_diff.action([a] { return diff(*a); });

  const Subcommand of_explain =
      command
          .subcommand("explain", "Value, unit, allowed range and source of a key, or of all keys of a table")
          .example("equipoise config explain friction.compensation --config config/mbbr.toml");
  of_explain.option("key", a->key, "e.g. safety.max_tilt_rad, or safety").required();
  of_explain.option("--config", a->config, "robot configuration, TOML").file().required();
  common(of_explain);
  of_explain.action([a] { return explain(*a); });
}

}  // namespace equipoise::app
