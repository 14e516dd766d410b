#include "app/log/mcap_writer.hpp"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>

namespace equipoise::app {
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
constexpr std::size_t kChunkBytes = 1U << 20U;
constexpr int kCompressionLevel = 3;
enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

template <class Integer>
std::string little_endian(Integer value) {
  std::string bytes;
  for (std::size_t i = 0; i < sizeof value; ++i)
    bytes += static_cast<char>(static_cast<std::uint64_t>(value) >> (8U * i) & 0xFFU);
  return bytes;
}

std::string sized(const std::string& bytes) {
  return little_endian(static_cast<std::uint32_t>(bytes.size())) + bytes;
}

std::string whole_record(std::uint8_t opcode, const std::string& content) {
  return static_cast<char>(opcode) + little_endian(static_cast<std::uint64_t>(content.size())) + content;
}

/// CRC-32 as in zlib.
std::uint32_t crc32(std::string_view bytes) {
  static const auto kTable = [] {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t i = 0; i < table.size(); ++i) {
      std::uint32_t c = i;
      for (int bit = 0; bit < 8; ++bit) c = (c & 1U) != 0 ? 0xEDB88320U ^ (c >> 1U) : c >> 1U;
      table[i] = c;
    }
    return table;
  }();
  std::uint32_t crc = 0xFFFFFFFFU;
  for (const char byte : bytes) crc = kTable[(crc ^ static_cast<unsigned char>(byte)) & 0xFFU] ^ (crc >> 8U);
  return ~crc;
}

std::string compressed(const std::string& bytes) {
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size =
      ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), kCompressionLevel);
  if (ZSTD_isError(size) != 0) throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
  out.resize(size);
  return out;
}

}  // namespace

McapWriter::McapWriter(std::ostream& out) : out_(out) {
  write(std::string(kMagic));
  record(kHeader, sized("") + sized("equipoise"));
}

void McapWriter::write(const std::string& bytes) {
  out_ << bytes;
  position_ += bytes.size();
}

void McapWriter::record(std::uint8_t opcode, const std::string& content) {
  write(whole_record(opcode, content));
}

void McapWriter::metadata(const std::string& name, const std::map<std::string, std::string>& entries) {
  end_chunk();
  std::string map;
  for (const auto& [key, value] : entries) map += sized(key) + sized(value);
  const std::uint64_t start = position_;
  record(kMetadata, sized(name) + sized(map));
  metadata_indexes_.push_back(little_endian(start) + little_endian(position_ - start) + sized(name));
}

std::uint16_t McapWriter::add_channel(const std::string& topic, const std::string& schema) {
  const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
  Channel channel;
  channel.schema_record =
      whole_record(kSchema, little_endian(id) + sized(topic) + sized("jsonschema") + sized(schema));
  channel.record = whole_record(
      kChannel, little_endian(id) + little_endian(id) + sized(topic) + sized("json") + sized(""));
  chunk_.records += channel.schema_record + channel.record;
  channels_.push_back(channel);
  return id;
}

void McapWriter::message(std::uint16_t channel, std::int64_t t_ns, const std::string& json) {
  const auto time = static_cast<std::uint64_t>(t_ns);
  Channel& c = channels_.at(channel - 1U);
  if (chunk_.index.empty()) chunk_.from_ns = chunk_.to_ns = time;
  chunk_.from_ns = std::min(chunk_.from_ns, time);
  chunk_.to_ns = std::max(chunk_.to_ns, time);
  chunk_.index[channel].emplace_back(time, chunk_.records.size());
  chunk_.records += whole_record(kMessage, little_endian(channel) + little_endian(c.sequence++) +
                                               little_endian(time) + little_endian(time) + json);
  ++c.messages;
  if (chunk_.records.size() >= kChunkBytes) end_chunk();
}

void McapWriter::end_chunk() {
  if (chunk_.records.empty()) return;
  const bool first = chunk_indexes_.empty();
  from_ns_ = first ? chunk_.from_ns : std::min(from_ns_, chunk_.from_ns);
  to_ns_ = std::max(to_ns_, chunk_.to_ns);

  const std::string packed = compressed(chunk_.records);
  const std::uint64_t start = position_;
  const std::string sizes = little_endian(static_cast<std::uint64_t>(chunk_.records.size()));
  record(kChunk, little_endian(chunk_.from_ns) + little_endian(chunk_.to_ns) + sizes +
                     little_endian(crc32(chunk_.records)) + sized("zstd") +
                     little_endian(static_cast<std::uint64_t>(packed.size())) + packed);
  const std::uint64_t length = position_ - start;

  std::string offsets;  // of each channel's message index
  const std::uint64_t index_start = position_;
  for (const auto& [channel, entries] : chunk_.index) {
    offsets += little_endian(channel) + little_endian(position_);
    std::string rows;
    for (const auto& [time, offset] : entries) rows += little_endian(time) + little_endian(offset);
    record(kMessageIndex, little_endian(channel) + sized(rows));
  }
  chunk_indexes_.push_back(little_endian(chunk_.from_ns) + little_endian(chunk_.to_ns) +
                           little_endian(start) + little_endian(length) + sized(offsets) +
                           little_endian(position_ - index_start) + sized("zstd") +
                           little_endian(static_cast<std::uint64_t>(packed.size())) + sizes);
  chunk_ = Chunk{};
}

std::string McapWriter::statistics() const {
  std::uint64_t messages = 0;
  std::string counts;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    messages += channels_[i].messages;
    counts += little_endian(static_cast<std::uint16_t>(i + 1)) + little_endian(channels_[i].messages);
  }
  const auto count = [](std::size_t n) { return little_endian(static_cast<std::uint32_t>(n)); };
  return little_endian(messages) + little_endian(static_cast<std::uint16_t>(channels_.size())) +
         count(channels_.size()) + count(0) + count(metadata_indexes_.size()) + count(chunk_indexes_.size()) +
         little_endian(from_ns_) + little_endian(to_ns_) + sized(counts);
}

void McapWriter::finish() {
  end_chunk();
  record(kDataEnd, little_endian(std::uint32_t{0}));

  const std::uint64_t summary_start = position_;
  std::string offsets;
  std::string summary;
  const auto group = [&](std::uint8_t opcode, const std::string& records) {
    if (records.empty()) return;
    offsets += whole_record(kSummaryOffset, static_cast<char>(opcode) +
                                                little_endian(summary_start + summary.size()) +
                                                little_endian(static_cast<std::uint64_t>(records.size())));
    summary += records;
  };
  const auto all = [](std::uint8_t opcode, const std::vector<std::string>& contents) {
    std::string records;
    for (const std::string& content : contents) records += whole_record(opcode, content);
    return records;
  };
  std::string schemas;
  std::string channels;
  for (const Channel& channel : channels_) {
    schemas += channel.schema_record;
    channels += channel.record;
  }
  group(kSchema, schemas);
  group(kChannel, channels);
  group(kStatistics, whole_record(kStatistics, statistics()));
  group(kMetadataIndex, all(kMetadataIndex, metadata_indexes_));
  group(kChunkIndex, all(kChunkIndex, chunk_indexes_));

  const std::uint64_t offset_start = summary_start + summary.size();
  const std::string footer = little_endian(summary_start) + little_endian(offset_start);
  // The sum covers the summary up to itself, the footer's head included.
  const std::string head = static_cast<char>(kFooter) + little_endian(std::uint64_t{20}) + footer;
  const std::string covered = summary + offsets + head;
  write(covered + little_endian(crc32(covered)));
  write(std::string(kMagic));
}

}  // namespace equipoise::app
