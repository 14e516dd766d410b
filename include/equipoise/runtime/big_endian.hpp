// Numbers as a log and the wire have them: most significant byte first. In: value -> out: bytes; and back.
#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>

namespace equipoise::runtime {

/// Unsigned: of one, four or eight bytes. Returns the place behind.
template <class Unsigned>
std::uint8_t* store_big_endian(Unsigned value, std::uint8_t* to) noexcept {
  static_assert(sizeof value == 1 || sizeof value == 4 || sizeof value == 8);
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
  if constexpr (sizeof value == 8) value = __builtin_bswap64(value);
  if constexpr (sizeof value == 4) value = __builtin_bswap32(value);
#endif
  std::memcpy(to, &value, sizeof value);
  return to + sizeof value;
}

/// Of eight bytes at most.
inline std::uint64_t load_big_endian(std::string_view bytes) noexcept {
  std::uint64_t value = 0;
  for (const char byte : bytes) value = value << 8U | static_cast<unsigned char>(byte);
  return value;
}

}  // namespace equipoise::runtime
