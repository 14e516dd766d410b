#include "app/text/json.hpp"

#include <cstdio>
#include <fstream>

#include "app/text/errors.hpp"
#include "app/text/files.hpp"

template class nlohmann::basic_json<>;

namespace equipoise::app {
nlohmann::json read_json(const std::string& path) {
  try {
    return nlohmann::json::parse(read_text(path));
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(path + ": not valid JSON at byte " + std::to_string(error.byte));
  }
}

void write_json(const nlohmann::json& value, const std::string& path) {
  // File names need not be UTF-8.
  const std::string text = value.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  if (path == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return;
  }
  if (const std::string error = json_output_error(path); !error.empty()) throw InputError(error);
  std::ofstream file(path);
  file << text;
  if (!file.flush()) throw InputError(path + ": cannot be written");
}

}  // namespace equipoise::app
