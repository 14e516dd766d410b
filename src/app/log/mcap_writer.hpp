// Writes MCAP (https://mcap.dev/spec), unchunked, with JSON messages. In: topic, time, JSON -> out: stream.
// Not for the tick.
#pragma once

#include <cstdint>
#include <map>
#include <ostream>
#include <string>

#include "app/cli/json.hpp"

namespace equipoise::app {

class McapWriter {
 public:
  explicit McapWriter(std::ostream& out);

  void metadata(const std::string& name, const std::map<std::string, std::string>& entries);
  /// The first message of a topic decides the properties in its schema.
  void message(const std::string& topic, std::int64_t t_ns, const nlohmann::json& value);
  void finish();

 private:
  void record(std::uint8_t opcode, const std::string& content);
  std::uint16_t channel_of(const std::string& topic, const nlohmann::json& value);

  std::ostream& out_;
  std::map<std::string, std::uint16_t> channels_;
  std::uint32_t sequence_ = 0;
};

}  // namespace equipoise::app
