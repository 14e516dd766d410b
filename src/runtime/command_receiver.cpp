#include "equipoise/runtime/command_receiver.hpp"

#include <algorithm>
#include <cmath>

#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::runtime {

CommandReceiver::CommandReceiver(const CommandKeys& keys, const CommandReceiverOptions& options,
                                 std::unique_ptr<CommandWire> wire)
    : started_ns_(monotonic_now_ns()),
      journal_(options.journal),
      gate_(keys, std::llround(1e3 * options.timeout_s), options.robot),
      wire_(std::move(wire)),
      wish_(CommandWish{}),
      thread_([this] { run(); }) {}

CommandReceiver::~CommandReceiver() {
  stop_.store(true);
  thread_.join();
}

double CommandReceiver::now_ms() const noexcept {
  return 1e-6 * static_cast<double>(monotonic_now_ns() - started_ns_);
}

void CommandReceiver::run() {
  constexpr int kTurn_ms = 50;
  const double period_ms = 1e3 * std::max(0.1, 2.0 * wire_->interval_s());  // half the wire is for answers
  double next_ms = 0.0;
  while (!stop_.load()) {
    wire_->listen(kTurn_ms, [this](const std::uint8_t* data, std::size_t size) { receive(data, size); });
    if (now_ms() < next_ms) continue;
    next_ms = now_ms() + period_ms;
    announce(0);
  }
}

void CommandReceiver::receive(const std::uint8_t* data, std::size_t size) {
  signed_command_t message;
  const int length = static_cast<int>(std::min<std::size_t>(size, kLongestMessage + 1));
  if (message.decode(data, 0, length) != length) return;
  const CommandGate::Verdict verdict = gate_.accept(message, static_cast<std::int64_t>(now_ms()));
  if (verdict == CommandGate::Verdict::kRefused) return;  // no answer for whoever repeats what was said
  if (verdict == CommandGate::Verdict::kObeyed) wish_.put(gate_.wish());
  announce(message.sender);
  if (verdict == CommandGate::Verdict::kObeyed) note(message);
}

void CommandReceiver::announce(std::int64_t to) {
  const std::int64_t followed = followed_.load(std::memory_order_acquire);
  const bool up_to_date = followed / 4 == gate_.wish().turn;
  const auto state = up_to_date ? static_cast<std::int8_t>(followed % 4) : command_session_t::WAITING;
  wire_->say(encoded(gate_.announcement(static_cast<std::int64_t>(now_ms()), state, to)));
}

void CommandReceiver::note(const signed_command_t& message) const {
  if (!journal_ || message.action == signed_command_t::DRIVE) return;
  const char* const what = message.action == signed_command_t::ARM      ? " asks for the motors"
                           : message.action == signed_command_t::DISARM ? " disarms"
                                                                        : " resets the heading";
  journal_(name_in(message.holder) + what);
}

Command CommandReceiver::latest() noexcept { return follower_.update(wish_.get(), now_ms()); }

void CommandReceiver::tell(ArmState state) noexcept {
  follower_.tell(state);
  followed_.store(4 * follower_.turn() + follower_.state(), std::memory_order_release);
}

}  // namespace equipoise::runtime
