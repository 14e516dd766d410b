#include "app/log/log_reader.hpp"

#include <cstdio>
#include <filesystem>

#include "app/cli/commands.hpp"

namespace equipoise::app {
namespace {

constexpr std::string_view kSync("\xED\xA1\xDA\x01", 4);
constexpr std::size_t kHeader = 28;  // sync, number, time in microseconds, lengths of channel and data
constexpr std::size_t kLongestChannel = 256;
constexpr std::size_t kLargestMessage = 1U << 24U;

std::uint64_t big_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (const char byte : bytes) value = value << 8U | static_cast<unsigned char>(byte);
  return value;
}

std::size_t length(std::string_view four_bytes) { return static_cast<std::size_t>(big_endian(four_bytes)); }

}  // namespace

bool LogReader::next(LogEvent* event) {
  while (at_ < bytes_.size()) {
    const std::string_view rest = bytes_.substr(at_);
    if (rest.size() >= kHeader && rest.substr(0, 4) == kSync) {
      const std::size_t channel = length(rest.substr(20, 4));
      const std::size_t data = length(rest.substr(24, 4));
      if (channel <= kLongestChannel && data <= kLargestMessage && kHeader + channel + data <= rest.size()) {
        event->utime = static_cast<std::int64_t>(big_endian(rest.substr(12, 8)));
        event->channel = rest.substr(kHeader, channel);
        event->data = rest.substr(kHeader + channel, data);
        at_ += kHeader + channel + data;
        return true;
      }
    }
    const std::size_t following = rest.find(kSync, 1);
    const std::size_t skipped = following == std::string_view::npos ? rest.size() : following;
    damaged_ += skipped;
    at_ += skipped;
  }
  return false;
}

std::string read_log_parts(const std::string& path) {
  std::string bytes = read_text(path);
  const std::filesystem::path p(path);
  for (int i = 1;; ++i) {
    char middle[16];
    std::snprintf(middle, sizeof middle, ".%04d", i);
    const std::filesystem::path part =
        p.parent_path() / (p.stem().string() + middle + p.extension().string());
    if (!std::filesystem::exists(part)) return bytes;
    bytes += read_text(part.string());
  }
}

}  // namespace equipoise::app
