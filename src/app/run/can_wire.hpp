// Command messages on a classic CAN bus: frames of frames.hpp, eight bytes of them per data frame. In: bus ->
// out: messages. Several may talk at once: each has an identifier of 16 to itself, and leaves it when it
// hears somebody else there; each identifier is reassembled on its own. Not RT-safe.
#pragma once

#include <linux/can.h>

#include <array>
#include <memory>

#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/command_wire.hpp"

namespace equipoise::app {

/// Classic frames without blocking; false: none now, or no room now.
class CanBus : NoCopy {
 public:
  virtual ~CanBus() = default;

  virtual bool receive(can_frame* out) = 0;
  virtual bool send(const can_frame& frame) = 0;
};

class CanWire final : public runtime::CommandWire {
 public:
  static constexpr std::uint32_t kTalkers = 16;
  static constexpr std::uint32_t kToRobot = 0x1D0;    // and the 15 after it
  static constexpr std::uint32_t kFromRobot = 0x1F0;  // so

  CanWire(std::unique_ptr<CanBus> bus, runtime::WireSide side);

  void listen(int milliseconds, const Received& received) override;
  void say(const std::vector<std::uint8_t>& message) override;

 private:
  /// True when it completed a message.
  bool take(const can_frame& frame, const Received& received);

  std::unique_ptr<CanBus> bus_;
  std::uint32_t heard_;
  std::uint32_t said_;  // of this side's; ours is one of the 16
  std::uint32_t talker_;
  std::array<runtime::FrameReader, kTalkers> readers_;
};

}  // namespace equipoise::app
