#include "equipoise/runtime/frames.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

namespace equipoise::runtime {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes message_of(std::size_t size, std::uint8_t first) {
  Bytes message(size);
  std::iota(message.begin(), message.end(), first);
  return message;
}

Bytes frame_of(const Bytes& message) { return to_frame(message.data(), message.size()); }

std::vector<Bytes> read(FrameReader& reader, const Bytes& stream) {
  std::vector<Bytes> messages;
  reader.push(stream.data(), stream.size(),
              [&](const std::uint8_t* data, std::size_t size) { messages.emplace_back(data, data + size); });
  return messages;
}

TEST(Frames, CarryEveryLength) {
  FrameReader reader;
  for (std::size_t size = 1; size <= kLongestMessage; ++size) {
    const Bytes message = message_of(size, 7);
    EXPECT_EQ(read(reader, frame_of(message)), std::vector<Bytes>{message});
  }
  EXPECT_TRUE(to_frame(nullptr, 0).empty());
  const Bytes too_long(kLongestMessage + 1);
  EXPECT_TRUE(frame_of(too_long).empty());
}

TEST(Frames, KnownSum) {  // CRC-16/CCITT-FALSE of 01 41
  const Bytes message{0x41};
  const Bytes frame = frame_of(message);
  ASSERT_EQ(frame.size(), 6U);
  unsigned crc = 0xFFFF;  // by long division, bit by bit
  for (const unsigned byte : {0x01U, 0x41U}) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      const bool out = ((crc >> 15U) & 1U) != ((byte >> (7U - bit)) & 1U);
      crc = (crc << 1U) & 0xFFFFU;
      if (out) crc ^= 0x1021U;
    }
  }
  EXPECT_EQ(frame[4] << 8U | frame[5], static_cast<int>(crc));
}

TEST(Frames, ArriveByteByByteAmongRubbish) {
  FrameReader reader;
  const Bytes message = message_of(40, 1);
  const Bytes frame = frame_of(message);
  Bytes stream{0x00, 0xEA, 0xEA, 0x11, 0x00};
  stream.insert(stream.end(), frame.begin(), frame.end());
  std::vector<Bytes> all;
  for (const std::uint8_t byte : stream) {
    for (const Bytes& m : read(reader, {byte})) all.push_back(m);
  }
  EXPECT_EQ(all, std::vector<Bytes>{message});
}

TEST(Frames, ALostOrChangedByteCostsItsFrameAndNoOther) {
  const Bytes first = message_of(60, 1);
  const Bytes second = message_of(30, 100);
  const Bytes a = frame_of(first);
  const Bytes b = frame_of(second);
  for (std::size_t at = 0; at < a.size(); ++at) {
    for (const bool lost : {true, false}) {
      Bytes stream = a;
      if (lost) {
        stream.erase(stream.begin() + static_cast<std::ptrdiff_t>(at));
      } else {
        stream[at] ^= 0x10U;
      }
      // A spoilt length swallows what follows until enough has come to see that the sum is wrong.
      for (int i = 0; i < 12; ++i) stream.insert(stream.end(), b.begin(), b.end());
      FrameReader reader;
      const std::vector<Bytes> messages = read(reader, stream);
      EXPECT_GE(messages.size(), at == 2 ? 5U : 12U) << at;
      for (const Bytes& m : messages) EXPECT_EQ(m, second) << at;
    }
  }
}

TEST(Frames, NoiseIsNoMessage) {
  FrameReader reader;
  std::mt19937 engine(1);
  Bytes noise(100000);
  for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(engine());
  EXPECT_LE(read(reader, noise).size(), 1U);  // one chance in 65536 for every EA 11
}

}  // namespace
}  // namespace equipoise::runtime
