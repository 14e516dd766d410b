// The node of an IIO device's buffer: a named pipe, which a driver polls and reads as it does the real one.
// In: fields of a scan in the order of their index -> out: the bytes that the kernel would deliver, each
// field aligned to its size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

/// Attributes of a device that delivers `kinds` ("in_accel") as the kernel's drivers of IMUs do.
std::map<std::string, std::string> iio_attributes(const std::string& name,
                                                  const std::vector<std::string>& kinds,
                                                  const std::string& type);

class FakeIio {
 public:
  struct Field {
    std::int64_t value;
    std::size_t bytes = 2;
    bool big_endian = false;
  };

  explicit FakeIio(std::string node);
  ~FakeIio();
  FakeIio(const FakeIio&) = delete;
  FakeIio& operator=(const FakeIio&) = delete;

  void push(const std::vector<Field>& fields);
  void pushBytes(const std::vector<unsigned char>& bytes);
  void unplug();  // what is read afterwards is the end of the file

 private:
  std::string node_;
  int fd_ = -1;
};
