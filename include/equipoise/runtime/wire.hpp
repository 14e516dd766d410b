// Records as LCM messages: fingerprint, utime, tick (where the type has one), then the fields in the order of
// fields.hpp, big-endian. In: record -> out: bytes of a message; and back, false for bytes that are none of
// this type and version. Not for the tick.
#pragma once

#include <algorithm>
#include <cstring>
#include <equipoise/command_t.hpp>
#include <equipoise/faults_t.hpp>
#include <equipoise/health_t.hpp>
#include <equipoise/motors_t.hpp>
#include <equipoise/run_t.hpp>
#include <equipoise/sensors_t.hpp>
#include <equipoise/state_t.hpp>
#include <equipoise/timing_histogram_t.hpp>
#include <equipoise/timing_t.hpp>
#include <equipoise/verdict_t.hpp>
#include <iterator>
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
inline std::int64_t fingerprint(fields::Faults) { return faults_t::getHash(); }
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

/// Of a text in a message: LCM's strings hold no zero but their last.
inline std::size_t text_length(const std::string& text) { return std::min(text.find('\0'), text.size()); }

/// Counts bytes, and writes them where there is room: into nullptr they are only counted.
class Encoder {
 public:
  explicit Encoder(std::uint8_t* to) : to_(to) {}

  template <class T>
  void operator()(const char*, const T& value) {
    put(value);
  }
  template <class T>
  void put(const T& value) {
    if constexpr (kIsScalar<T>) {
      Unsigned<T> bits{};
      std::memcpy(&bits, &value, sizeof value);
      if (to_ != nullptr) store_big_endian(bits, to_ + size_);
      size_ += sizeof bits;
    } else if constexpr (std::is_same_v<T, std::string>) {
      const std::size_t length = text_length(value);
      put(static_cast<std::int32_t>(length + 1));
      for (std::size_t i = 0; i < length; ++i) put(value[i]);
      put('\0');
    } else {
      for (const auto& element : value) put(element);
    }
  }
  std::size_t size() const { return size_; }

 private:
  std::uint8_t* to_;
  std::size_t size_ = 0;
};

class Decoder {
 public:
  explicit Decoder(std::string_view bytes) : bytes_(bytes) {}

  template <class T>
  void operator()(const char*, T& value) {
    take(value);
  }
  template <class T>
  void take(T& value) {
    if constexpr (kIsScalar<T>) {
      if (!has(sizeof(T))) return;
      const auto bits = static_cast<Unsigned<T>>(load_big_endian(bytes_.substr(0, sizeof(T))));
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

/// All numbers of a message in their order.
template <class Message, class Record, class Visit>
void walk(Message message, const Record& record, std::int64_t utime, std::int64_t tick, Visit& visit) {
  visit.put(fingerprint(message));
  visit.put(utime);
  if constexpr (kHasTick<Message>) visit.put(tick);
  Message::visit(record, visit);
}

template <class Message, class Record>
void encode(Message message, const Record& record, std::int64_t utime, std::int64_t tick, Bytes* out) {
  wire::Encoder counting(nullptr);
  walk(message, record, utime, tick, counting);
  out->resize(counting.size());
  wire::Encoder writing(out->data());
  walk(message, record, utime, tick, writing);
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
