#include "app/remote/hand_remote.hpp"

#include <algorithm>
#include <cmath>

#include "app/remote/event_device.hpp"
#include "app/remote/frame_device.hpp"
#include "equipoise/runtime/monotonic.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {
namespace {

double now_ms() noexcept { return 1e3 * runtime::now_s(); }

}  // namespace

Hand HandGate::limit(const Hand& hand) noexcept {
  Hand allowed = hand;
  if (hand.arm || hand.disarm) must_let_go_ = true;
  if (hand.forward == 0.0 && hand.left == 0.0 && hand.turn == 0.0) must_let_go_ = false;
  const double travel = std::hypot(hand.forward, hand.left);
  const double share = must_let_go_ ? 0.0 : 1.0 / std::max(1.0, travel);
  allowed.forward *= share;
  allowed.left *= share;
  if (must_let_go_) allowed.turn = 0.0;
  return allowed;
}

std::unique_ptr<HandDevice> open_hand(const RemoteFile& file) {
  if (file.kind == RemoteFile::Kind::kFrames) return std::make_unique<FrameDevice>(file);
  return std::make_unique<EventDevice>(file);
}

HandRemote::HandRemote(std::unique_ptr<HandDevice> device, Options options)
    : options_(std::move(options)),
      device_(std::move(device)),
      wish_(runtime::CommandWish{}),
      thread_([this] { run(); }) {}

HandRemote::~HandRemote() {
  stop_.store(true);
  thread_.join();
}

void HandRemote::run() {
  constexpr int kLook_ms = 20;
  HandGate gate;
  runtime::CommandWish wish;
  bool present = true;
  const auto note = [this](const char* what) {
    if (options_.journal) options_.journal(std::string("the remote ") + what);
  };
  while (!stop_.load()) {
    const Hand hand = gate.limit(device_->look(kLook_ms));
    const auto now = static_cast<std::int64_t>(now_ms());
    if (hand.disarm) {
      if (wish.arm) note("disarms");
      wish.arm = false;
      ++wish.disarms;
    } else if (hand.arm) {
      note("asks for the motors");
      wish.arm = true;
      ++wish.arms;
      wish.arm_until_ms = now + std::llround(1e3 * options_.timeout_s);
    }
    if (hand.heading_reset) {
      note("resets the heading");
      ++wish.heading_resets;
    }
    wish.velocity_W_m_s[0] = options_.speed_m_s * hand.forward;
    wish.velocity_W_m_s[1] = options_.speed_m_s * hand.left;
    wish.yaw_rate_rad_s = 2.0 * kPi * options_.turn_hz * hand.turn;
    if (hand.heard) wish.heard_ms = now;
    if (hand.present != present) note(hand.present ? "is back" : "is gone: nothing moves");
    present = hand.present;
    wish_.put(wish);
  }
}

Command HandRemote::latest() noexcept { return follower_.update(wish_.get(), now_ms()); }

}  // namespace equipoise::app
