// Messages on a stream of bytes that may lose or invent some: UART, CAN. A frame is EA 11, length (1 .. 255),
// the message, CRC-16/CCITT (poly 1021, start FFFF, big-endian) of length and message.
// In: bytes in any portions -> out: whole frames whose sum is right, in order; what is damaged is skipped. It
// protects from noise, not from people: messages prove their sender themselves (command_auth.hpp).
// Bounded time and memory, no allocation in FrameReader.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace equipoise::runtime {

inline constexpr std::size_t kLongestMessage = 255;
inline constexpr std::size_t kFrameOverhead = 5;

/// Empty when the message is empty or too long.
std::vector<std::uint8_t> to_frame(const std::uint8_t* message, std::size_t size);

class FrameReader {
 public:
  /// received(message, size) for every frame that ends in this portion.
  template <class Receive>
  void push(const std::uint8_t* data, std::size_t size, Receive&& received) {
    for (std::size_t i = 0; i < size; ++i) {
      buffer_[filled_++] = data[i];
      while (const std::size_t used = step()) {
        if (complete_) received(buffer_.data() + 3, used - kFrameOverhead);
        drop(used);
      }
    }
  }

 private:
  /// Bytes at the front that are done with, as a frame (complete_) or as rubbish; 0: more are needed.
  std::size_t step() noexcept;
  void drop(std::size_t count) noexcept;

  std::array<std::uint8_t, kLongestMessage + kFrameOverhead> buffer_{};
  std::size_t filled_ = 0;
  bool complete_ = false;
};

}  // namespace equipoise::runtime
