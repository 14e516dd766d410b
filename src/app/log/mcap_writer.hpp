// Writes MCAP (https://mcap.dev/spec): JSON messages in chunks compressed with zstd, a message index behind
// each chunk, and a summary (schemas, channels, statistics, chunk and metadata index), so that a viewer can
// seek. In: topic, time, JSON -> out: stream; memory bounded by one chunk and the index of all. Not for the
// tick.
#pragma once

#include <cstdint>
#include <map>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace equipoise::app {

class McapWriter {
 public:
  explicit McapWriter(std::ostream& out);

  void metadata(const std::string& name, const std::map<std::string, std::string>& entries);
  /// A topic's number; `schema` is a JSON schema.
  std::uint16_t add_channel(const std::string& topic, const std::string& schema);
  void message(std::uint16_t channel, std::int64_t t_ns, const std::string& json);
  void finish();

 private:
  struct Chunk {
    std::string records;  // uncompressed
    std::uint64_t from_ns = 0;
    std::uint64_t to_ns = 0;
    std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> index;  // time, offset
  };
  struct Channel {
    std::string schema_record, record;
    std::uint64_t messages = 0;
    std::uint32_t sequence = 0;
  };

  void write(const std::string& bytes);
  void record(std::uint8_t opcode, const std::string& content);
  void end_chunk();
  std::string statistics() const;

  std::ostream& out_;
  std::uint64_t position_ = 0;
  Chunk chunk_;
  std::vector<Channel> channels_;  // number minus 1
  std::vector<std::string> chunk_indexes_, metadata_indexes_;
  std::uint64_t from_ns_ = 0;
  std::uint64_t to_ns_ = 0;
};

}  // namespace equipoise::app
