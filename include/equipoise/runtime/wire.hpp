// Records as LCM messages: fingerprint, utime, tick (where the type has one), then the fields in the order of
// fields.hpp, big-endian. In: record -> out: bytes of a message; and back, false for bytes that are none of
// this type and version. Encoding reuses the buffer's memory. Not for the tick.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <equipoise/command_t.hpp>
#include <equipoise/health_t.hpp>
#include <equipoise/motors_t.hpp>
#include <equipoise/run_t.hpp>
#include <equipoise/sensors_t.hpp>
#include <equipoise/state_t.hpp>
#include <equipoise/timing_histogram_t.hpp>
#include <equipoise/timing_t.hpp>
#include <equipoise/verdict_t.hpp>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "equipoise/runtime/big_endian.hpp"
#include "equipoise/runtime/fields.hpp"

namespace equipoise::runtime {

using Bytes = std::vector<std::uint8_t>;

// What lcm-gen makes of lcm/*.lcm is used for the fingerprint, which changes with the type.
inline std::int64_t fingerprint(fields::Sensors) { return sensors_t::getHash(); }
inline std::int64_t fingerprint(fields::CommandFields) { return command_t::getHash(); }
inline std::int64_t fingerprint(fields::State) { return state_t::getHash(); }
inline std::int64_t fingerprint(fields::Motors) { return motors_t::getHash(); }
inline std::int64_t fingerprint(fields::Health) { return health_t::getHash(); }
inline std::int64_t fingerprint(fields::Timing) { return timing_t::getHash(); }
inline std::int64_t fingerprint(fields::Histogram) { return timing_histogram_t::getHash(); }
inline std::int64_t fingerprint(fields::End) { return verdict_t::getHash(); }
inline std::int64_t fingerprint(fields::Run) { return run_t::getHash(); }

template <class Message>
inline constexpr bool kHasTick = !std::is_same_v<Message, fields::Run>;

namespace wire {

template <class T>
inline constexpr bool kIsScalar = std::is_arithmetic_v<T>;

/// Bytes of a scalar in a message: bits go as int32_t, bool as one byte.
template <class T>
using Unsigned = std::conditional_t<sizeof(T) == 8, std::uint64_t,
                                    std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint8_t>>;

/// Writes from the beginning of `out`, which has the message's size once the encoder is gone.
class Encoder {
 public:
  explicit Encoder(Bytes* out) : out_(*out) { out_.resize(kUsual); }
  ~Encoder() { out_.resize(used_); }
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  template <class T>
  void operator()(const char*, const char*, const T& value) {
    put(value);
  }
  template <class T>
  void put(const T& value) {
    if constexpr (kIsScalar<T>) {
      Unsigned<T> bits{};
      std::memcpy(&bits, &value, sizeof value);
      store_big_endian(bits, room(sizeof bits));
    } else if constexpr (std::is_same_v<T, std::string>) {
      const std::size_t end = std::min(value.find('\0'), value.size());  // LCM's strings hold no zero
      put(static_cast<std::int32_t>(end + 1));
      std::uint8_t* const text = room(end + 1);
      std::memcpy(text, value.data(), end);
      text[end] = 0;
    } else {
      for (const auto& element : value) put(element);
    }
  }

 private:
  static constexpr std::size_t kUsual = 256;  // bytes; most messages of a tick are shorter

  std::uint8_t* room(std::size_t size) {
    const std::size_t at = used_;
    used_ += size;
    if (used_ > out_.size()) out_.resize(2 * used_);
    return out_.data() + at;
  }

  Bytes& out_;
  std::size_t used_ = 0;
};

class Decoder {
 public:
  explicit Decoder(std::string_view bytes) : bytes_(bytes) {}

  template <class T>
  void operator()(const char*, const char*, T& value) {
    take(value);
  }
  template <class T>
  void take(T& value) {
    if constexpr (kIsScalar<T>) {
      if (!has(sizeof(T))) return;
      Unsigned<T> bits{};
      for (std::size_t i = 0; i < sizeof(T); ++i) {
        bits = static_cast<Unsigned<T>>(static_cast<std::uint64_t>(bits) << 8U |
                                        static_cast<unsigned char>(bytes_[i]));
      }
      if constexpr (std::is_same_v<T, bool>) {
        value = bits != 0;
      } else {
        std::memcpy(&value, &bits, sizeof value);
      }
      bytes_.remove_prefix(sizeof(T));
    } else if constexpr (std::is_same_v<T, std::string>) {
      std::int32_t size = 0;  // its end included
      take(size);
      if (size < 1 || !has(static_cast<std::size_t>(size))) {
        whole_ = false;
        return;
      }
      value.assign(bytes_.substr(0, static_cast<std::size_t>(size) - 1));
      bytes_.remove_prefix(static_cast<std::size_t>(size));
    } else {
      for (auto& element : value) take(element);
    }
  }
  /// Nothing was missing and nothing is left.
  bool whole() const { return whole_ && bytes_.empty(); }

 private:
  bool has(std::size_t size) {
    whole_ = whole_ && size <= bytes_.size();
    return whole_;
  }

  std::string_view bytes_;
  bool whole_ = true;
};

}  // namespace wire

template <class Message, class Record>
void encode(Message message, const Record& record, std::int64_t utime, std::int64_t tick, Bytes* out) {
  wire::Encoder encoder(out);
  encoder.put(fingerprint(message));
  encoder.put(utime);
  if constexpr (kHasTick<Message>) encoder.put(tick);
  Message::visit(record, encoder);
}

/// False, and `record` is undefined, unless these are the bytes of one such message. `tick` may stay as it
/// is.
template <class Message, class Record>
bool decode(Message message, std::string_view bytes, Record* record, std::int64_t* utime,
            std::int64_t* tick) {
  wire::Decoder decoder(bytes);
  std::int64_t found = 0;
  decoder.take(found);
  if (found != fingerprint(message)) return false;
  decoder.take(*utime);
  if constexpr (kHasTick<Message>) decoder.take(*tick);
  Message::visit(*record, decoder);
  return decoder.whole();
}

}  // namespace equipoise::runtime
