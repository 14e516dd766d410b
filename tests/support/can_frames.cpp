// can_frames say SIDE: an LCM message in hex on stdin -> the CAN frames that the wire of that side (robot,
// owner) makes of it, one "ID#DATA" a line, as candump has them. can_frames hear SIDE: such frames on stdin
// -> the messages, in hex.
#include <cstdio>
#include <deque>
#include <iostream>
#include <string>

#include "app/run/can_wire.hpp"

namespace {

using equipoise::app::CanBus;
using equipoise::app::CanWire;
using equipoise::runtime::WireSide;

std::vector<std::uint8_t> from_hex(const std::string& text) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
  return bytes;
}

/// What is sent goes to stdout; what is on stdin is received.
class Pipe final : public CanBus {
 public:
  bool receive(can_frame* out) override {
    std::string line;
    if (!std::getline(std::cin, line)) {
      ended_ = true;
      return false;
    }
    const std::size_t hash = line.find('#');
    const std::vector<std::uint8_t> data = from_hex(line.substr(hash + 1));
    *out = can_frame{};
    out->can_id = static_cast<canid_t>(std::stoul(line.substr(0, hash), nullptr, 16));
    out->can_dlc = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), out->data);
    return true;
  }
  bool send(const can_frame& frame) override {
    std::printf("%03X#", frame.can_id);
    for (int i = 0; i < frame.can_dlc; ++i) std::printf("%02X", frame.data[i]);
    std::printf("\n");
    return true;
  }
  static bool ended_;
};
bool Pipe::ended_ = false;

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const bool robot = std::string(argv[2]) == "robot";
  CanWire wire(std::make_unique<Pipe>(), robot ? WireSide::kRobot : WireSide::kOwner);
  if (std::string(argv[1]) == "say") {
    std::string hex;
    std::getline(std::cin, hex);
    const std::vector<std::uint8_t> message = from_hex(hex);
    wire.say(message);
    return 0;
  }
  while (!Pipe::ended_) {
    wire.listen(10, [](const std::uint8_t* message, std::size_t size) {
      for (std::size_t i = 0; i < size; ++i) std::printf("%02X", message[i]);
      std::printf("\n");
    });
  }
  return 0;
}
