#include "equipoise/runtime/command_receiver.hpp"

#include <algorithm>
#include <chrono>

namespace equipoise::runtime {

CommandReceiver::CommandReceiver(const CommandKey& key, std::unique_ptr<CommandWire> wire)
    : queue_(64), gate_(key), wire_(std::move(wire)), thread_([this] { run(); }) {}

CommandReceiver::~CommandReceiver() {
  stop_.store(true);
  thread_.join();
}

void CommandReceiver::run() {
  constexpr int kTurn_ms = 50;
  constexpr auto kAnnounce = std::chrono::milliseconds(100);
  std::chrono::steady_clock::time_point next{};
  while (!stop_.load()) {
    wire_->listen(kTurn_ms, [this](const std::uint8_t* data, std::size_t size) { receive(data, size); });
    const auto now = std::chrono::steady_clock::now();
    if (now < next) continue;
    next = now + kAnnounce;
    say(*wire_, gate_.session());
  }
}

void CommandReceiver::receive(const std::uint8_t* data, std::size_t size) {
  signed_command_t message;
  const int length = static_cast<int>(std::min<std::size_t>(size, kLongestMessage + 1));
  Command command;
  if (message.decode(data, 0, length) != length || !gate_.accept(message, &command)) return;
  queue_.push({command.velocity_W_m_s.x(), command.velocity_W_m_s.y(), command.yaw_rate_rad_s, command.arm,
               command.heading_reset});
}

Command CommandReceiver::latest(std::int64_t now_ns) noexcept {
  Plain next{};
  while (queue_.pop(&next)) {
    Command command;
    command.velocity_W_m_s = Vec2(next.x, next.y);
    command.yaw_rate_rad_s = next.yaw_rate;
    command.arm = next.arm;
    command.heading_reset = next.heading_reset;
    latest_.renew(command, now_ns);
  }
  return latest_.at(now_ns);
}

}  // namespace equipoise::runtime
