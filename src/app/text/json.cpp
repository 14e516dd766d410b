#include "app/text/json.hpp"

#include <cstdio>
#include <filesystem>
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
  } catch (const nlohmann::json::out_of_range&) {
    throw InputError(path + ": holds a number that is too large");
  }
}

std::string json_output_error(const std::string& path) {
  if (path == "-") return "";
  if (std::string error = output_error(path, {"{", "["}, "JSON"); !error.empty()) return error;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return "";
  std::ifstream file(path);
  const bool ours = (file >> std::ws).eof() || nlohmann::json::accept(file);
  return ours ? "" : path + ": exists and holds no JSON; choose another name";
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
  if (file.flush()) return;
  file.close();
  std::error_code ignored;  // half of it is no JSON, which the next result would not replace
  if (std::filesystem::is_regular_file(path, ignored)) std::filesystem::remove(path, ignored);
  throw InputError(path + ": cannot be written");
}

}  // namespace equipoise::app
