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

std::string little_endian(std::uint64_t value, std::size_t bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8U * i) & 0xFFU);
  return text;
}
std::string u16(std::uint64_t value) { return little_endian(value, 2); }
std::string u32(std::uint64_t value) { return little_endian(value, 4); }
std::string u64(std::uint64_t value) { return little_endian(value, 8); }

std::string sized(const std::string& bytes) { return u32(bytes.size()) + bytes; }

std::string whole_record(std::uint8_t opcode, const std::string& content) {
  return static_cast<char>(opcode) + u64(content.size()) + content;
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
  metadata_indexes_.push_back(u64(start) + u64(position_ - start) + sized(name));
}

std::uint16_t McapWriter::add_channel(const std::string& topic, const std::string& schema) {
  const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
  Channel channel;
  channel.schema_record = whole_record(kSchema, u16(id) + sized(topic) + sized("jsonschema") + sized(schema));
  channel.record = whole_record(kChannel, u16(id) + u16(id) + sized(topic) + sized("json") + sized(""));
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
  chunk_.records += whole_record(kMessage, u16(channel) + u32(c.sequence++) + u64(time) + u64(time) + json);
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
  const std::string sizes = u64(chunk_.records.size());
  record(kChunk, u64(chunk_.from_ns) + u64(chunk_.to_ns) + sizes + u32(crc32(chunk_.records)) +
                     sized("zstd") + u64(packed.size()) + packed);
  const std::uint64_t length = position_ - start;

  std::string offsets;  // of each channel's message index
  const std::uint64_t index_start = position_;
  for (const auto& [channel, entries] : chunk_.index) {
    offsets += u16(channel) + u64(position_);
    std::string rows;
    for (const auto& [time, offset] : entries) rows += u64(time) + u64(offset);
    record(kMessageIndex, u16(channel) + sized(rows));
  }
  chunk_indexes_.push_back(u64(chunk_.from_ns) + u64(chunk_.to_ns) + u64(start) + u64(length) +
                           sized(offsets) + u64(position_ - index_start) + sized("zstd") +
                           u64(packed.size()) + sizes);
  chunk_ = Chunk{};
}

std::string McapWriter::statistics() const {
  std::uint64_t messages = 0;
  std::string counts;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    messages += channels_[i].messages;
    counts += u16(i + 1) + u64(channels_[i].messages);
  }
  return u64(messages) + u16(channels_.size()) + u32(channels_.size()) + u32(0) +
         u32(metadata_indexes_.size()) + u32(chunk_indexes_.size()) + u64(from_ns_) + u64(to_ns_) +
         sized(counts);
}

void McapWriter::finish() {
  end_chunk();
  record(kDataEnd, u32(0));

  const std::uint64_t summary_start = position_;
  std::string offsets;
  std::string summary;
  const auto group = [&](std::uint8_t opcode, const std::string& records) {
    if (records.empty()) return;
    offsets += whole_record(kSummaryOffset, static_cast<char>(opcode) + u64(summary_start + summary.size()) +
                                                u64(records.size()));
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
  const std::string footer = u64(summary_start) + u64(offset_start);
  // The sum covers the summary up to itself, the footer's head included.
  const std::string head = static_cast<char>(kFooter) + u64(20) + footer;
  const std::string covered = summary + offsets + head;
  write(covered + u32(crc32(covered)));
  write(std::string(kMagic));
}

}  // namespace equipoise::app
