#include "app/log/log_reader.hpp"

#include <filesystem>

#include "app/text/errors.hpp"
#include "equipoise/runtime/big_endian.hpp"
#include "equipoise/runtime/log_parts.hpp"

namespace equipoise::app {
namespace {

using runtime::kLogSync;
constexpr std::size_t kEventHeader = 28;  // sync, number, time in microseconds, lengths of channel and data
constexpr std::size_t kLongestChannel = 256;
constexpr std::size_t kLargestMessage = 1U << 24U;
constexpr std::size_t kReadBytes = 1U << 18U;

std::size_t length(std::string_view four_bytes) {
  return static_cast<std::size_t>(runtime::load_big_endian(four_bytes));
}

}  // namespace

LogReader LogReader::open(const std::string& path) {
  LogReader reader;
  reader.parts_ = runtime::existing_log_parts(path);
  if (reader.parts_.empty() || !reader.next_part()) throw InputError(path + ": cannot be read");
  return reader;
}

LogReader LogReader::over(std::string bytes) {
  LogReader reader;
  reader.buffer_ = std::move(bytes);
  return reader;
}

void LogReader::show_progress(const std::string& what) {
  std::error_code ignored;
  total_bytes_ = 1.0;
  for (const std::string& part : parts_)
    total_bytes_ += static_cast<double>(std::filesystem::file_size(part, ignored));
  progress_ = std::make_unique<Progress>(what);
}

bool LogReader::next_part() {
  if (next_part_ == parts_.size()) return false;
  const std::string& path = parts_[next_part_++];
  file_.close();
  file_.clear();
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    throw InputError(path + ": cannot be read: no regular file");
  file_.open(path, std::ios::binary);
  if (!file_) throw InputError(path + ": cannot be read");
  return true;
}

/// So many bytes of this part are in the buffer from at_ on.
bool LogReader::has(std::size_t bytes) {
  while (buffer_.size() - at_ < bytes) {
    if (!file_.is_open() || !file_) return false;
    buffer_.erase(0, at_);
    at_ = 0;
    const std::size_t kept = buffer_.size();
    buffer_.resize(kept + kReadBytes);
    file_.read(buffer_.data() + kept, static_cast<std::streamsize>(kReadBytes));
    buffer_.resize(kept + static_cast<std::size_t>(file_.gcount()));
    read_bytes_ += static_cast<double>(file_.gcount());
    if (progress_ != nullptr) progress_->at(read_bytes_ / total_bytes_);
  }
  return true;
}

void LogReader::skip_to_sync() {
  ++at_;
  ++damaged_;
  while (has(kLogSync.size())) {
    const std::size_t found = buffer_.find(kLogSync, at_);
    const std::size_t to = found != std::string::npos ? found : buffer_.size() - (kLogSync.size() - 1);
    damaged_ += to - at_;
    at_ = to;
    if (found != std::string::npos) return;
  }
  damaged_ += buffer_.size() - at_;
  at_ = buffer_.size();
}

bool LogReader::next(LogEvent* event) {
  for (;;) {
    if (!has(1)) {
      if (!next_part()) return false;
      continue;
    }
    if (has(kEventHeader) && buffer_.compare(at_, kLogSync.size(), kLogSync) == 0) {
      const std::string_view header(buffer_.data() + at_, kEventHeader);
      const std::size_t channel = length(header.substr(20, 4));
      const std::size_t data = length(header.substr(24, 4));
      const auto utime = static_cast<std::int64_t>(runtime::load_big_endian(header.substr(12, 8)));
      if (channel <= kLongestChannel && data <= kLargestMessage && has(kEventHeader + channel + data)) {
        const std::string_view body(buffer_.data() + at_ + kEventHeader, channel + data);
        *event = {utime, body.substr(0, channel), body.substr(channel)};
        at_ += kEventHeader + channel + data;
        return true;
      }
    }
    skip_to_sync();
  }
}

}  // namespace equipoise::app
