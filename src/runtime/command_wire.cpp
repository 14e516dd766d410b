#include "equipoise/runtime/command_wire.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <thread>

namespace equipoise::runtime {
namespace {

constexpr const char* kCommandChannel = "EQUIPOISE_SIGNED_COMMAND";
constexpr const char* kSessionChannel = "EQUIPOISE_COMMAND_SESSION";

class LcmWire final : public CommandWire {
 public:
  LcmWire(const std::string& url, WireSide side)
      : lcm_(url), said_(side == WireSide::kRobot ? kSessionChannel : kCommandChannel) {
    if (!lcm_.good()) {
      throw std::runtime_error("commands: " + url +
                               " cannot be opened (is there a route for multicast? "
                               "ip route add 224.0.0.0/4 dev lo)");
    }
    lcm_.subscribeFunction(
        side == WireSide::kRobot ? kCommandChannel : kSessionChannel,
        +[](const lcm::ReceiveBuffer* buffer, const std::string&, LcmWire* self) {
          if (self->received_ != nullptr)
            (*self->received_)(static_cast<const std::uint8_t*>(buffer->data), buffer->data_size);
        },
        this);
  }

  void listen(int milliseconds, const Received& received) override {
    received_ = &received;
    lcm_.handleTimeout(milliseconds);
    received_ = nullptr;
  }

  void say(const std::vector<std::uint8_t>& message) override {
    lcm_.publish(said_, message.data(), static_cast<unsigned>(message.size()));
  }

 private:
  lcm::LCM lcm_;
  std::string said_;
  const Received* received_ = nullptr;
};

}  // namespace

std::unique_ptr<CommandWire> open_lcm_wire(const std::string& url, WireSide side) {
  return std::make_unique<LcmWire>(url, side);
}

void StreamWire::listen(int milliseconds, const Received& received) {
  constexpr auto kPoll = std::chrono::milliseconds(2);
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(milliseconds);
  std::array<std::uint8_t, 256> portion{};
  bool any = false;
  do {
    const std::size_t count = stream_->read(portion.data(), portion.size());
    reader_.push(portion.data(), count, [&](const std::uint8_t* message, std::size_t size) {
      any = true;
      received(message, size);
    });
    if (count == 0) std::this_thread::sleep_for(kPoll);
  } while (!any && std::chrono::steady_clock::now() < end);
}

void StreamWire::say(const std::vector<std::uint8_t>& message) {
  const std::vector<std::uint8_t> frame = to_frame(message.data(), message.size());
  constexpr int kPatience_ms = 100;  // a CAN queue holds ten frames; a dead line loses the rest of ours
  std::size_t taken = 0;
  for (int waited_ms = 0; taken < frame.size() && waited_ms < kPatience_ms;) {
    const std::size_t more = stream_->write(frame.data() + taken, frame.size() - taken);
    taken += more;
    if (more > 0) continue;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ++waited_ms;
  }
}

double StreamWire::interval_s() const {
  constexpr double kFrameBytes = 128.0;  // a signed command, with some air
  return std::max(CommandWire::interval_s(), kFrameBytes / stream_->bytes_per_s());
}

}  // namespace equipoise::runtime
