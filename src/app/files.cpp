#include <cstdio>
#include <fstream>
#include <sstream>

#include "commands.hpp"

namespace equipoise::app {

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) throw InputError(path + ": cannot be read");
  return text.str();
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
