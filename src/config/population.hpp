// Robots of a population: the table [population] of a configuration mirrors a world's table and gives each
// key a range. In: file, overrides, world, number of the robot -> out: overrides that make the world that
// robot's. The same number is the same robot on every machine. Start-up only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/toml_reader.hpp"

namespace equipoise::config {

/// One key of a world, e.g. disturbance.static_ratio, as drawn; several values for an array.
struct Drawn {
  std::string key;
  std::vector<double> values;
};

/// Robot 0 is the world as configured: nothing is drawn. ConfigError for a key that the world lacks.
std::vector<Drawn> draw_robot(const std::string& path, const std::vector<std::string>& overrides,
                              const std::string& world, std::int64_t robot);

/// At every start, whether or not a robot is drawn: ConfigError for a key that no world has.
void check_population(const toml::table& root);

/// `drawn` before `overrides`, so that these have the last word.
std::vector<std::string> with_robot_drawn(const std::vector<Drawn>& drawn, const std::string& world,
                                          const std::vector<std::string>& overrides);

/// Uniform in [0, 1): a number per robot, key and element, without any library's distribution.
double unit_draw(std::int64_t robot, const std::string& key, std::size_t element) noexcept;
/// Mean 0, variance 1, within +-6: the sum of twelve uniform ones less six.
double normal_draw(std::int64_t robot, const std::string& key, std::size_t element) noexcept;

}  // namespace equipoise::config
