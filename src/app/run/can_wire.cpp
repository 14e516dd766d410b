#include "app/run/can_wire.hpp"

#include <algorithm>
#include <chrono>
#include <random>
#include <thread>

namespace equipoise::app {
namespace {

std::uint32_t any_talker() { return std::random_device{}() % CanWire::kTalkers; }

}  // namespace

CanWire::CanWire(std::unique_ptr<CanBus> bus, runtime::WireSide side)
    : bus_(std::move(bus)),
      heard_(side == runtime::WireSide::kRobot ? kToRobot : kFromRobot),
      said_(side == runtime::WireSide::kRobot ? kFromRobot : kToRobot),
      talker_(any_talker()) {}

bool CanWire::take(const can_frame& frame, const Received& received) {
  if (frame.can_id == said_ + talker_) talker_ = any_talker();  // never our own frame: another's
  const std::uint32_t from = frame.can_id - heard_;  // flags and lower identifiers end up far above
  if (from >= kTalkers) return false;
  bool any = false;
  readers_[from].push(frame.data, std::min<std::size_t>(frame.can_dlc, CAN_MAX_DLEN),
                      [&](const std::uint8_t* message, std::size_t size) {
                        any = true;
                        received(message, size);
                      });
  return any;
}

void CanWire::listen(int milliseconds, const Received& received) {
  constexpr auto kPoll = std::chrono::milliseconds(2);
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(milliseconds);
  can_frame frame{};
  for (bool any = false; !any && std::chrono::steady_clock::now() < end;) {
    if (bus_->receive(&frame)) {
      any = take(frame, received);
    } else {
      std::this_thread::sleep_for(kPoll);
    }
  }
}

void CanWire::say(const std::vector<std::uint8_t>& message) {
  constexpr int kPatience_ms = 100;  // the interface's queue holds ten frames; a dead bus loses the rest
  const std::vector<std::uint8_t> bytes = runtime::to_frame(message.data(), message.size());
  int waited_ms = 0;
  for (std::size_t at = 0; at < bytes.size() && waited_ms < kPatience_ms;) {
    can_frame frame{};
    frame.can_id = said_ + talker_;
    frame.can_dlc = static_cast<std::uint8_t>(std::min<std::size_t>(bytes.size() - at, CAN_MAX_DLEN));
    std::copy_n(bytes.data() + at, frame.can_dlc, frame.data);
    if (bus_->send(frame)) {
      at += frame.can_dlc;
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      ++waited_ms;
    }
  }
}

}  // namespace equipoise::app
