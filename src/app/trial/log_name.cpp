#include "app/trial/log_name.hpp"

#include <ctime>
#include <filesystem>

namespace equipoise::app {

std::string new_log_name(const std::string& kind, const std::string& robot) {
  std::filesystem::create_directories("logs");
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char when[32];
  std::strftime(when, sizeof when, "%Y%m%dT%H%M%SZ", &utc);
  const std::string stem = "logs/" + kind + "-" + robot + "-" + when;
  std::string path = stem + ".lcm";
  for (int i = 2; std::filesystem::exists(path); ++i) path = stem + "-" + std::to_string(i) + ".lcm";
  return path;
}

}  // namespace equipoise::app
