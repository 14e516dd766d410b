#include "commands.hpp"

#include <cstdio>
#include <fstream>

namespace equipoise::app {

void add_commands(CLI::App& app, int* status) {
  add_sim(app, status);
  add_model(app, status);
  add_bridge(app, status);
  add_geometry(app, status);
  add_motor_bench(app, status);
  add_identify(app, status);
  add_friction_rig(app, status);
}

nlohmann::json read_json(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw InputError(path + ": cannot be opened");
  try {
    return nlohmann::json::parse(file);
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(path + ": not valid JSON at byte " + std::to_string(error.byte));
  }
}

void write_json(const nlohmann::json& value, const std::string& path) {
  const std::string text = value.dump(2) + "\n";
  if (path == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return;
  }
  std::ofstream file(path);
  file << text;
  if (!file.flush()) throw InputError(path + ": cannot be written");
}

}  // namespace equipoise::app
