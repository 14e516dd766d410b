#include "app/remote/frame_device.hpp"

#include <poll.h>

#include <chrono>
#include <cstring>
#include <stdexcept>
#include <thread>

#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {
std::optional<HandAction> FrameMatcher::push(char byte) {
  begun_.push_back(byte);
  while (!begun_.empty()) {
    bool may_go_on = false;
    for (const FrameBinding& frame : frames_) {
      if (frame.bytes == begun_) {
        begun_.clear();
        return frame.action;
      }
      may_go_on |= frame.bytes.compare(0, begun_.size(), begun_) == 0;
    }
    if (may_go_on) break;
    begun_.erase(0, 1);
  }
  return std::nullopt;
}

void ButtonPad::press(HandAction action, double now_s) {
  heard_until_s_ = now_s + hold_s_;
  if (action == HandAction::kStop) {
    until_s_.fill(kNever_s);
  } else if (action == HandAction::kArm) {
    const bool again = now_s - armed_at_s_ <= kArmTwiceWithin_s;
    if (again && !arm_told_) pressed_.arm = true;
    arm_told_ = again;  // held on, it is one press
    armed_at_s_ = now_s;
  } else if (action == HandAction::kDisarm) {
    pressed_.disarm = true;
    armed_at_s_ = kNever_s;
  } else if (action == HandAction::kHeadingReset) {
    pressed_.heading_reset = true;
  } else {
    until_s_[index_of(action)] = now_s + hold_s_;
  }
}

Hand ButtonPad::hand(double now_s) {
  Hand hand = pressed_;
  pressed_ = Hand{};
  const auto held = [&](HandAction action) { return now_s <= until_s_[index_of(action)] ? 1.0 : 0.0; };
  hand.heard = now_s <= heard_until_s_;
  hand.forward = held(HandAction::kForward) - held(HandAction::kBack);
  hand.left = held(HandAction::kLeft) - held(HandAction::kRight);
  hand.turn = held(HandAction::kTurnLeft) - held(HandAction::kTurnRight);
  return hand;
}

FrameDevice::FrameDevice(RemoteFile file)
    : file_(std::move(file)), matcher_(file_.frames), pad_(file_.hold_s) {
  const int status = serial_open(&serial_, file_.device.c_str(), static_cast<std::uint32_t>(file_.baud));
  if (status < 0)
    throw std::runtime_error("serial: " + file_.device + ": " + std::strerror(-status) +
                             "; [remote] device: the port's path (/dev/rfcomm0), or its address on a board");
}

FrameDevice::~FrameDevice() { serial_close(&serial_); }

Hand FrameDevice::look(int milliseconds) {
  if (serial_.fd < 0 &&
      serial_open(&serial_, file_.device.c_str(), static_cast<std::uint32_t>(file_.baud)) < 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    Hand hand = pad_.hand(runtime::now_s());
    hand.present = false;
    return hand;
  }
  pollfd ready{serial_.fd, POLLIN, 0};
  (void)poll(&ready, 1, milliseconds);
  std::array<std::uint8_t, 256> bytes{};
  const int count = serial_read(&serial_, bytes.data(), bytes.size());
  if (count == -EIO || count == -ENODEV) serial_close(&serial_);  // the adapter was pulled out
  constexpr double kQuiet_s = 0.2;
  const double now = runtime::now_s();
  if (count > 0 && now - byte_s_ > kQuiet_s) matcher_.forget();
  if (count > 0) byte_s_ = now;
  for (int i = 0; i < count; ++i) {
    const auto action = matcher_.push(static_cast<char>(bytes[static_cast<std::size_t>(i)]));
    if (action) pad_.press(*action, now);
  }
  return pad_.hand(now);
}

}  // namespace equipoise::app
