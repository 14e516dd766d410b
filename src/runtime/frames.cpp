#include "equipoise/runtime/frames.hpp"

#include <algorithm>

namespace equipoise::runtime {
namespace {

constexpr std::uint8_t kFirst = 0xEA;
constexpr std::uint8_t kSecond = 0x11;

std::uint16_t crc(const std::uint8_t* data, std::size_t size) noexcept {
  unsigned sum = 0xFFFF;
  for (std::size_t i = 0; i < size; ++i) {
    sum ^= static_cast<unsigned>(data[i]) << 8U;
    for (int bit = 0; bit < 8; ++bit) sum = (sum & 0x8000U) != 0 ? (sum << 1U) ^ 0x1021U : sum << 1U;
  }
  return static_cast<std::uint16_t>(sum & 0xFFFFU);
}

}  // namespace

std::vector<std::uint8_t> to_frame(const std::uint8_t* message, std::size_t size) {
  if (size == 0 || size > kLongestMessage) return {};
  std::vector<std::uint8_t> frame{kFirst, kSecond, static_cast<std::uint8_t>(size)};
  frame.insert(frame.end(), message, message + size);
  const std::uint16_t sum = crc(frame.data() + 2, size + 1);
  frame.push_back(static_cast<std::uint8_t>(sum >> 8U));
  frame.push_back(static_cast<std::uint8_t>(sum & 0xFFU));
  return frame;
}

std::size_t FrameReader::step() noexcept {
  complete_ = false;
  if (filled_ == 0) return 0;
  if (buffer_[0] != kFirst) return 1;
  if (filled_ < 2) return 0;
  if (buffer_[1] != kSecond) return 1;
  if (filled_ < 3) return 0;
  const std::size_t length = buffer_[2];
  if (length == 0) return 1;
  const std::size_t whole = length + kFrameOverhead;
  if (filled_ < whole) return 0;
  const std::uint16_t sum = crc(buffer_.data() + 2, length + 1);
  complete_ = buffer_[whole - 2] == sum >> 8U && buffer_[whole - 1] == (sum & 0xFFU);
  return complete_ ? whole : 1;  // after a lost byte a good frame may hide in what looked like this one
}

void FrameReader::drop(std::size_t count) noexcept {
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(count),
            buffer_.begin() + static_cast<std::ptrdiff_t>(filled_), buffer_.begin());
  filled_ -= count;
}

}  // namespace equipoise::runtime
