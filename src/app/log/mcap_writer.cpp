#include "app/log/mcap_writer.hpp"

#include <string_view>

namespace equipoise::app {
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kMetadata = 0x0C,
  kDataEnd = 0x0F,
};

template <class Integer>
std::string little_endian(Integer value) {
  std::string bytes;
  for (std::size_t i = 0; i < sizeof value; ++i)
    bytes += static_cast<char>(static_cast<std::uint64_t>(value) >> (8U * i) & 0xFFU);
  return bytes;
}

std::string text(const std::string& value) {
  return little_endian(static_cast<std::uint32_t>(value.size())) + value;
}

}  // namespace

McapWriter::McapWriter(std::ostream& out) : out_(out) {
  out_ << kMagic;
  record(kHeader, text("") + text("equipoise"));
}

void McapWriter::record(std::uint8_t opcode, const std::string& content) {
  out_ << static_cast<char>(opcode) << little_endian(static_cast<std::uint64_t>(content.size())) << content;
}

void McapWriter::metadata(const std::string& name, const std::map<std::string, std::string>& entries) {
  std::string map;
  for (const auto& [key, value] : entries) map += text(key) + text(value);
  record(kMetadata, text(name) + text(map));
}

std::uint16_t McapWriter::channel_of(const std::string& topic, const nlohmann::json& value) {
  const auto known = channels_.find(topic);
  if (known != channels_.end()) return known->second;
  const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
  channels_[topic] = id;
  nlohmann::json schema = {{"type", "object"}, {"properties", nlohmann::json::object()}};
  for (const auto& [name, field] : value.items()) schema["properties"][name] = {{"type", "number"}};
  record(kSchema, little_endian(id) + text(topic) + text("jsonschema") + text(schema.dump()));
  record(kChannel, little_endian(id) + little_endian(id) + text(topic) + text("json") + text(""));
  return id;
}

void McapWriter::message(const std::string& topic, std::int64_t t_ns, const nlohmann::json& value) {
  const std::uint16_t channel = channel_of(topic, value);
  record(kMessage, little_endian(channel) + little_endian(sequence_++) + little_endian(t_ns) +
                       little_endian(t_ns) + value.dump());
}

void McapWriter::finish() {
  record(kDataEnd, little_endian(std::uint32_t{0}));
  record(kFooter,
         little_endian(std::uint64_t{0}) + little_endian(std::uint64_t{0}) + little_endian(std::uint32_t{0}));
  out_ << kMagic;
}

}  // namespace equipoise::app
