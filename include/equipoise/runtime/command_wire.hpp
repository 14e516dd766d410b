// What commands and their receiver's session travel on, seen from either side. In: encoded LCM messages ->
// out: the other side's, whole. Wires do not judge: CommandGate does. Not RT-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/frames.hpp"

namespace equipoise::runtime {

class CommandWire : NoCopy {
 public:
  using Received = std::function<void(const std::uint8_t*, std::size_t)>;

  virtual ~CommandWire() = default;

  /// At most this long, ms.
  virtual void listen(int milliseconds, const Received& received) = 0;
  virtual void say(const std::vector<std::uint8_t>& message) = 0;
  /// Commands may follow each other at this interval without queueing up on the way.
  virtual double interval_s() const { return 0.05; }
};

/// An LCM message.
template <class Message>
std::vector<std::uint8_t> encoded(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

enum class WireSide { kRobot, kOwner };  // the robot hears commands and says its session

/// LCM, channels EQUIPOISE_SIGNED_COMMAND and EQUIPOISE_COMMAND_SESSION; runtime_error when the URL cannot be
/// opened.
std::unique_ptr<CommandWire> open_lcm_wire(const std::string& url, WireSide side);

/// Bytes without blocking: how many were read or taken; 0: none now.
class ByteStream : NoCopy {
 public:
  virtual ~ByteStream() = default;

  virtual std::size_t read(std::uint8_t* out, std::size_t size) = 0;
  virtual std::size_t write(const std::uint8_t* data, std::size_t size) = 0;
  virtual double bytes_per_s() const = 0;
};

/// Frames on a stream of bytes.
class StreamWire final : public CommandWire {
 public:
  explicit StreamWire(std::unique_ptr<ByteStream> stream) : stream_(std::move(stream)) {}

  void listen(int milliseconds, const Received& received) override;
  void say(const std::vector<std::uint8_t>& message) override;
  double interval_s() const override;

 private:
  std::unique_ptr<ByteStream> stream_;
  FrameReader reader_;
};

}  // namespace equipoise::runtime
