#include "equipoise/runtime/log_parts.hpp"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <ctime>
#include <filesystem>

namespace equipoise::runtime {
namespace {

namespace fs = std::filesystem;

bool digits(const std::string& text, std::size_t from, std::size_t count) {
  return text.size() >= from + count && std::all_of(text.begin() + static_cast<std::ptrdiff_t>(from),
                                                    text.begin() + static_cast<std::ptrdiff_t>(from + count),
                                                    [](unsigned char c) { return std::isdigit(c) != 0; });
}

/// What stands between NAME and the suffix in each file beside `path` that has both.
std::vector<std::string> middles(const fs::path& path) {
  const std::string start = path.stem().string() + ".";
  const std::string suffix = path.extension().string();
  std::vector<std::string> found;
  std::error_code error;
  for (fs::directory_iterator it(path.has_parent_path() ? path.parent_path() : ".", error), end;
       !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.size() > start.size() + suffix.size() && name.compare(0, start.size(), start) == 0 &&
        name.compare(name.size() - suffix.size(), suffix.size(), suffix) == 0)
      found.push_back(name.substr(start.size(), name.size() - start.size() - suffix.size()));
  }
  return found;
}

std::string with_middle(const fs::path& path, const std::string& middle) {
  return (path.parent_path() / (path.stem().string() + "." + middle + path.extension().string())).string();
}

bool is_stamp(const std::string& text) {  // 20261122T014503Z, and .0001 of a part behind it
  return digits(text, 0, 8) && digits(text, 9, 6) && text[8] == 'T' && text.size() > 15 && text[15] == 'Z';
}

}  // namespace

std::string log_part(const std::string& path, int number) {
  if (number == 0) return path;
  char middle[16];
  std::snprintf(middle, sizeof middle, "%04d", number);
  return with_middle(path, middle);
}

int log_part_number(const std::string& path, const std::string& part) {
  if (part == path) return 0;
  const std::size_t suffix = fs::path(path).extension().string().size();
  return std::stoi(part.substr(path.size() - suffix + 1));
}

std::vector<std::string> existing_log_parts(const std::string& path) {
  std::vector<int> numbers;
  for (const std::string& middle : middles(path)) {
    if (middle.size() >= 4 && middle.size() <= 9 && digits(middle, 0, middle.size()))
      numbers.push_back(std::stoi(middle));
  }
  std::sort(numbers.begin(), numbers.end());
  std::vector<std::string> parts;
  std::error_code error;
  if (fs::exists(path, error)) parts.push_back(path);
  for (const int number : numbers) parts.push_back(log_part(path, number));
  return parts;
}

std::vector<std::string> kept_logs(const std::string& path) {
  std::vector<std::string> kept = middles(path);
  kept.erase(std::remove_if(kept.begin(), kept.end(), [](const std::string& m) { return !is_stamp(m); }),
             kept.end());
  std::sort(kept.begin(), kept.end());
  for (std::string& middle : kept) middle = with_middle(path, middle);
  return kept;
}

std::string kept_name(const std::string& path, std::int64_t time_s) {
  const auto time = static_cast<std::time_t>(time_s);
  std::tm utc{};
  gmtime_r(&time, &utc);
  char stamp[32];
  (void)std::strftime(stamp, sizeof stamp, "%Y%m%dT%H%M%SZ", &utc);
  std::string name = with_middle(path, stamp);
  std::error_code error;
  for (int i = 2; !existing_log_parts(name).empty(); ++i)
    name = with_middle(path, std::string(stamp) + "-" + std::to_string(i));
  return name;
}

}  // namespace equipoise::runtime
