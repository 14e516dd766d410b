#include "fake_iio.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

namespace fs = std::filesystem;

std::map<std::string, std::string> iio_attributes(const std::string& name,
                                                  const std::vector<std::string>& kinds,
                                                  const std::string& type) {
  // A file keeps what is behind the bytes that are written to it: what a driver writes was empty before.
  std::map<std::string, std::string> out{
      {"name", name},         {"sampling_frequency", ""}, {"current_timestamp_clock", ""},
      {"buffer/enable", "0"}, {"buffer/length", ""},      {"buffer/watermark", ""}};
  int index = 0;
  const auto channel = [&](const std::string& each, const std::string& its_type) {
    const std::string file = "scan_elements/" + each;
    out[file + "_en"] = "0";
    out[file + "_type"] = its_type;
    out[file + "_index"] = std::to_string(index++);
  };
  for (const std::string& kind : kinds) {
    out[kind + "_scale"] = "";
    out[kind + "_scale_available"] = kind == "in_accel" ? "0.000598 0.001196 0.002392 0.004785"
                                                        : "0.000133090 0.000266181 0.000532362 0.001064724";
    for (const char* axis : {"_x", "_y", "_z"}) channel(kind + axis, type);
  }
  channel("in_timestamp", "le:s64/64>>0");
  return out;
}

FakeIio::FakeIio(std::string node) : node_(std::move(node)) {
  fs::create_directories(fs::path(node_).parent_path());
  if (mkfifo(node_.c_str(), 0600) != 0) std::abort();
  fd_ = ::open(node_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);  // a reader never sees an end
}

FakeIio::~FakeIio() { unplug(); }

void FakeIio::unplug() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

void FakeIio::push(const std::vector<Field>& fields) {
  std::vector<unsigned char> scan;
  std::size_t largest = 1;
  for (const Field& field : fields) {
    while (scan.size() % field.bytes != 0) scan.push_back(0);
    largest = std::max(largest, field.bytes);
    for (std::size_t i = 0; i < field.bytes; ++i) {
      const std::size_t byte = field.big_endian ? field.bytes - 1 - i : i;
      scan.push_back(static_cast<unsigned char>(static_cast<std::uint64_t>(field.value) >> (8 * byte)));
    }
  }
  while (scan.size() % largest != 0) scan.push_back(0);
  pushBytes(scan);
}

void FakeIio::pushBytes(const std::vector<unsigned char>& bytes) {
  if (::write(fd_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) std::abort();
}
