// Keeps every tick of a run as the log would have it, in columns by channel. In: TickRecord -> out: per
// channel the names, types and counts of its fields and the packed values, native byte order. Memory grows
// with the run.
#pragma once

#include <cstring>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "equipoise/runtime/fields.hpp"

namespace equipoise::python {

struct Column {
  std::string name;
  char type;  // of Python's struct module
  int count;  // 0: a scalar
};

struct Channel {
  std::vector<Column> columns;
  std::string packed;
};

class Recorder {
 public:
  explicit Recorder(const std::vector<std::string>& estimators) {
    for (const std::string& name : estimators) {
      std::string channel(runtime::fields::kComparedChannel);
      for (const char c : name) channel += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
      compared_.push_back(channel);
    }
  }

  void add(const runtime::TickRecord& r) {
    namespace fields = runtime::fields;
    fields::each_message(
        r, [&](auto message, const char* channel, const auto& record) { put(message, channel, record, r); });
    if (r.has_truth) put(fields::State{}, fields::kTruthChannel, r.truth, r);
    for (std::size_t i = 0; i < compared_.size() && i < r.others.size(); ++i) {
      if ((r.compared >> i & 1U) != 0) put(fields::State{}, compared_[i].c_str(), r.others[i], r);
    }
  }

  const std::map<std::string, Channel>& channels() const { return channels_; }

 private:
  template <class Message, class Record>
  void put(Message, const char* name, const Record& record, const runtime::TickRecord& tick) {
    Channel& channel = channels_[name];
    const bool first = channel.columns.empty();
    const auto field = [&](const char* column, const char*, const auto& value) {
      if (first) channel.columns.push_back(described(column, value));
      channel.packed.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    field("utime", "us", tick.now_ns / 1000);
    field("tick", "", tick.tick);
    Message::visit(record, field);
  }

  template <class T>
  static Column described(const char* name, const T& value) {
    if constexpr (std::is_arithmetic_v<T>) {
      return {name, code<T>(), 0};
    } else {
      return {name, code<std::decay_t<decltype(value[0])>>(), static_cast<int>(std::size(value))};
    }
  }

  template <class T>
  static constexpr char code() {
    if (std::is_same_v<T, bool>) return '?';
    if (std::is_floating_point_v<T>) return sizeof(T) == 8 ? 'd' : 'f';
    constexpr const char* kSigned = "bhiq";
    constexpr std::size_t kPower = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
    return kSigned[kPower];  // LCM has signed numbers only
  }

  std::vector<std::string> compared_;
  std::map<std::string, Channel> channels_;
};

}  // namespace equipoise::python
