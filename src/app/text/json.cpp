#include "app/text/json.hpp"

#include <cstdio>
#include <fstream>

#include "app/text/errors.hpp"

template class nlohmann::basic_json<>;

namespace equipoise::app {

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
