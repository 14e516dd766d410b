#include "equipoise/runtime/log_parts.hpp"

#include <regex.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "equipoise/runtime/big_endian.hpp"

namespace equipoise::runtime {
namespace {

namespace fs = std::filesystem;

bool matches(const std::string& text, const char* pattern) {
  regex_t compiled;
  if (regcomp(&compiled, pattern, REG_EXTENDED | REG_NOSUB) != 0) return false;
  const bool found = regexec(&compiled, text.c_str(), 0, nullptr, 0) == 0;
  regfree(&compiled);
  return found;
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

/// What kept_name writes: 20261122T014503Z, -2 of a second in that second, .0001 of a part behind it.
bool is_stamp(const std::string& text) {
  return matches(text, "^[0-9]{8}T[0-9]{6}Z(-[0-9]+)?(\\.[0-9]{4,})?$");
}

/// Event number at the start of an LCM log; -1: no log.
std::int64_t first_event_number(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return -1;
  std::string head(kLogSync.size() + 8, '\0');
  std::ifstream file(path, std::ios::binary);
  if (!file.read(head.data(), static_cast<std::streamsize>(head.size())) || head.rfind(kLogSync, 0) != 0)
    return -1;
  return static_cast<std::int64_t>(load_big_endian(std::string_view(head).substr(kLogSync.size())));
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

/// The events of a log are numbered through all its parts: a file whose name merely looks like a part's is
/// another log, begun at 0, or none.
std::vector<std::string> existing_log_parts(const std::string& path) {
  std::vector<int> numbers;
  for (const std::string& middle : middles(path)) {
    if (!matches(middle, "^[0-9]{1,9}$") || with_middle(path, middle) != log_part(path, std::stoi(middle)))
      continue;
    if (first_event_number(with_middle(path, middle)) > 0) numbers.push_back(std::stoi(middle));
  }
  std::sort(numbers.begin(), numbers.end());
  std::vector<std::string> parts;
  std::error_code error;
  if (fs::exists(path, error)) parts.push_back(path);
  for (const int number : numbers) parts.push_back(log_part(path, number));
  return parts;
}

bool is_log_or_empty(const std::string& path) {
  std::error_code error;
  return fs::file_size(path, error) == 0 || first_event_number(path) >= 0;
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
  const std::string stamp = utc_text(time_s);
  const std::vector<std::string> taken = middles(path);
  std::string middle = stamp;
  const auto is_taken = [&middle](const std::string& other) {
    return other == middle || other.rfind(middle + ".", 0) == 0;
  };
  for (int i = 2; std::any_of(taken.begin(), taken.end(), is_taken); ++i)
    middle = stamp + "-" + std::to_string(i);
  return with_middle(path, middle);
}

}  // namespace equipoise::runtime
