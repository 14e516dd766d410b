#include "app/text/files.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "app/text/errors.hpp"
#include "equipoise/runtime/log_parts.hpp"

namespace equipoise::app {
namespace {

namespace fs = std::filesystem;

/// Nobody at the other end of a named pipe: opening it would wait for ever.
bool is_unread_pipe(const std::string& path) {
  std::error_code error;
  if (!fs::is_fifo(path, error)) return false;
  const int fd = open(path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd >= 0) close(fd);
  return fd < 0;
}

}  // namespace

/// A pipe, a terminal or a device might never end; a shell's pipe is named under /dev or /proc.
std::string read_text(const std::string& path) {
  std::error_code error;
  const fs::file_type type = fs::status(path, error).type();
  const bool shells_pipe =
      type == fs::file_type::fifo && (path.rfind("/dev/", 0) == 0 || path.rfind("/proc/", 0) == 0);
  if (type != fs::file_type::regular && type != fs::file_type::not_found && !shells_pipe)
    throw InputError(path + ": cannot be read: no regular file");
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || (file.peek() != EOF && !(text << file.rdbuf()))) throw InputError(path + ": cannot be read");
  return text.str();
}

std::string output_error(const std::string& path, const std::vector<std::string>& beginnings,
                         const std::string& kind) {
  if (is_unread_pipe(path)) return path + ": is a pipe without a reader";
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return "";
  std::ifstream file(path, std::ios::binary);
  file >> std::ws;
  std::string begin(64, '\0');
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(static_cast<std::size_t>(file.gcount()));
  const bool ours =
      begin.empty() || std::any_of(beginnings.begin(), beginnings.end(),
                                   [&](const std::string& b) { return begin.rfind(b, 0) == 0; });
  return ours ? "" : path + ": exists and holds no " + kind + "; choose another name";
}

void check_output(const std::string& path, const std::vector<std::string>& beginnings,
                  const std::string& kind) {
  if (const std::string error = output_error(path, beginnings, kind); !error.empty()) throw InputError(error);
}

void check_log(const std::string& path) { check_output(path, {std::string(runtime::kLogSync)}, "log"); }

std::string printable(const std::string& text) {
  std::string out = text;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto c = static_cast<unsigned char>(out[i]);
    // U+0080 to U+009F, two bytes of UTF-8: terminals obey them like escapes.
    const bool two = c == 0xC2 && i + 1 < out.size() && static_cast<unsigned char>(out[i + 1]) < 0xA0;
    if ((c < 0x20 && c != '\n' && c != '\t') || c == 0x7F || two) out[i] = '?';
    if (two) out[++i] = '?';
  }
  return out;
}

std::string new_log_name(const std::string& kind, const std::string& robot) {
  std::filesystem::create_directories("logs");
  const std::string stem = "logs/" + kind + "-" + robot + "-" + runtime::utc_text(std::time(nullptr));
  std::string path = stem + ".lcm";
  for (int i = 2; std::filesystem::exists(path); ++i) path = stem + "-" + std::to_string(i) + ".lcm";
  return path;
}

}  // namespace equipoise::app
