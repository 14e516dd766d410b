#include "config/population.hpp"

#include "config/edits.hpp"
#include "equipoise/plant/noise.hpp"

namespace equipoise::config {
namespace {

std::uint64_t splitmix64(std::uint64_t z) noexcept { return mixed(z + 0x9E3779B97F4A7C15ULL); }

double unit(std::int64_t robot, const std::string& key, std::uint64_t element) noexcept {
  std::uint64_t hash = 0xCBF29CE484222325ULL;  // FNV-1a
  for (const char c : key) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  const std::uint64_t bits =
      splitmix64(splitmix64(hash ^ splitmix64(static_cast<std::uint64_t>(robot))) + element);
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

/// [low, high] uniform, or {sigma = s} about zero.
struct Range {
  bool uniform = true;
  double low = 0.0;
  double high = 0.0;  // or sigma
};

bool is_sigma(const toml::table& table) { return table.size() == 1 && table.contains("sigma"); }

Range range_of(const toml::node& node, const std::string& name) {
  if (const toml::table* table = node.as_table()) {
    const auto sigma = (*table)["sigma"].value<double>();
    if (!sigma || *sigma < 0.0) throw ConfigError(name + ": expected {sigma = number >= 0}");
    return {false, 0.0, *sigma};
  }
  const toml::array* pair = node.as_array();
  const bool two = pair != nullptr && pair->size() == 2;
  const auto low = two ? pair->get(0)->value<double>() : std::nullopt;
  const auto high = two ? pair->get(1)->value<double>() : std::nullopt;
  if (!low || !high || *low > *high) throw ConfigError(name + ": expected [low, high] or {sigma = number}");
  return {true, *low, *high};
}

/// Walks the population beside the world's table of the same shape.
void draw(const toml::table& ranges, const toml::table& world, const std::string& prefix, std::int64_t robot,
          std::vector<Drawn>* drawn) {
  for (const auto& [name, node] : ranges) {
    const std::string key = prefix + std::string(name.str());
    const toml::node* target = world.get(name.str());
    if (target == nullptr) throw ConfigError("population." + key + ": the world has no such key");
    const toml::table* nested = node.as_table();
    if (nested != nullptr && !is_sigma(*nested)) {
      if (!target->is_table()) throw ConfigError("population." + key + ": is no table in the world");
      draw(*nested, *target->as_table(), key + ".", robot, drawn);
      continue;
    }
    const Range range = range_of(node, "population." + key);
    const std::size_t count = target->is_array() ? target->as_array()->size() : 1;
    Drawn d{key, {}};
    for (std::size_t i = 0; i < count; ++i) {
      d.values.push_back(range.uniform ? range.low + (range.high - range.low) * unit_draw(robot, key, i)
                                       : range.high * normal_draw(robot, key, i));
    }
    drawn->push_back(std::move(d));
  }
}

/// Every key is one of some world's, and its range is one.
void check(const toml::table& ranges, const std::vector<const toml::table*>& worlds,
           const std::string& prefix) {
  for (const auto& [name, node] : ranges) {
    const std::string key = prefix + std::string(name.str());
    const toml::table* nested = node.as_table();
    const bool is_range = nested == nullptr || is_sigma(*nested);
    std::vector<const toml::table*> tables;
    bool known = false;
    for (const toml::table* world : worlds) {
      const toml::node* target = world->get(name.str());
      if (target == nullptr) continue;
      known = known || target->is_table() != is_range;
      if (target->is_table()) tables.push_back(target->as_table());
    }
    if (!known) throw ConfigError(key + ": no world has such a key");
    if (is_range) {
      (void)range_of(node, key);
    } else {
      check(*nested, tables, key + ".");
    }
  }
}

}  // namespace

double unit_draw(std::int64_t robot, const std::string& key, std::size_t element) noexcept {
  return unit(robot, key, static_cast<std::uint64_t>(element) << 8U);
}

double normal_draw(std::int64_t robot, const std::string& key, std::size_t element) noexcept {
  double sum = -6.0;
  for (std::uint64_t i = 1; i <= 12; ++i)
    sum += unit(robot, key, (static_cast<std::uint64_t>(element) << 8U) + i);
  return sum;
}

void check_population(const toml::table& root) {
  const toml::table* worlds = root["world"].as_table();
  if (worlds == nullptr) return;
  std::vector<const toml::table*> all;
  for (const auto& [name, node] : *worlds) {
    const toml::table* world = node.as_table();
    if (world == nullptr) continue;
    all.push_back(world);
    const toml::table* own = (*world)["population"].as_table();
    if (own != nullptr) check(*own, {world}, "world." + std::string(name.str()) + ".population.");
  }
  if (const toml::table* ranges = root["population"].as_table()) check(*ranges, all, "population.");
}

std::vector<Drawn> draw_robot(const std::string& path, const std::vector<std::string>& overrides,
                              const std::string& world, std::int64_t robot) {
  std::vector<Drawn> drawn;
  if (robot <= 0) return drawn;
  const Document document(path, overrides);
  const toml::table* target = document.root()["world"][world].as_table();
  if (target == nullptr) throw ConfigError(path + ": world." + world + ": missing");
  const toml::table* own = (*target)["population"].as_table();
  const toml::table* ranges = own != nullptr ? own : document.root()["population"].as_table();
  if (ranges == nullptr) throw ConfigError(path + ": population: missing; robots are drawn from it");
  draw(*ranges, *target, "", robot, &drawn);
  return drawn;
}

std::vector<std::string> with_robot_drawn(const std::vector<Drawn>& drawn, const std::string& world,
                                          const std::vector<std::string>& overrides) {
  std::vector<std::string> all;
  for (const Drawn& d : drawn) {
    std::string setting = "world." + world + "." + d.key + "=";
    const bool list = d.values.size() > 1;
    for (std::size_t i = 0; i < d.values.size(); ++i) {
      if (list) setting += i == 0 ? "[" : ", ";
      setting += shortest(d.values[i], 17);
    }
    if (list) setting += ']';
    all.push_back(std::move(setting));
  }
  all.insert(all.end(), overrides.begin(), overrides.end());
  return all;
}

}  // namespace equipoise::config
