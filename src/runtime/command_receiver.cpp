#include "equipoise/runtime/command_receiver.hpp"

#include <algorithm>
#include <chrono>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>

namespace equipoise::runtime {

class CommandReceiver::Link {
 public:
  Link(const CommandKey& key, const std::string& url, SpscQueue<Plain>* queue)
      : lcm_(url), gate_(key), queue_(queue) {
    if (!lcm_.good()) {
      throw std::runtime_error("commands: " + url +
                               " cannot be opened (is there a route for multicast? "
                               "ip route add 224.0.0.0/4 dev lo)");
    }
    lcm_.subscribeFunction(
        kCommandChannel,
        +[](const lcm::ReceiveBuffer* buffer, const std::string&, Link* self) { self->receive(*buffer); },
        this);
  }

  void turn() {
    constexpr int kTurn_ms = 50;
    constexpr auto kAnnounce = std::chrono::milliseconds(100);
    lcm_.handleTimeout(kTurn_ms);
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return;
    next_ = now + kAnnounce;
    const command_session_t session = gate_.session();
    lcm_.publish(kSessionChannel, &session);
  }

 private:
  void receive(const lcm::ReceiveBuffer& buffer) {
    signed_command_t message;
    const auto size = static_cast<int>(buffer.data_size);
    Command command;
    if (message.decode(buffer.data, 0, size) != size || !gate_.accept(message, &command)) return;
    queue_->push({command.velocity_W_m_s.x(), command.velocity_W_m_s.y(), command.yaw_rate_rad_s, command.arm,
                  command.heading_reset});
  }

  lcm::LCM lcm_;
  CommandGate gate_;
  SpscQueue<Plain>* queue_;
  std::chrono::steady_clock::time_point next_{};
};

CommandReceiver::CommandReceiver(const CommandKey& key, const std::string& url)
    : queue_(64), link_(std::make_unique<Link>(key, url, &queue_)), thread_([this] { run(); }) {}

CommandReceiver::~CommandReceiver() {
  stop_.store(true);
  thread_.join();
}

void CommandReceiver::run() {
  while (!stop_.load()) link_->turn();
}

Command CommandReceiver::latest() noexcept {
  Plain next{};
  current_.heading_reset = false;  // once per command
  age_ticks_ = std::min(age_ticks_ + 1, kTimeoutTicks);
  while (queue_.pop(&next)) {
    current_.velocity_W_m_s = Vec2(next.x, next.y);
    current_.yaw_rate_rad_s = next.yaw_rate;
    current_.arm = next.arm;
    current_.heading_reset = current_.heading_reset || next.heading_reset;
    age_ticks_ = 0;
  }
  if (age_ticks_ >= kTimeoutTicks) {
    current_.velocity_W_m_s.setZero();
    current_.yaw_rate_rad_s = 0.0;
  }
  return current_;
}

}  // namespace equipoise::runtime
