#include "app/remote/event_device.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>

#include "app/text/errors.hpp"
#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {
EventDevice::EventDevice(RemoteFile file) : file_(std::move(file)), controls_(file_.events.size()) {
  const int status = open();
  if (status == -ENOTTY || status == -ENOSYS)  // the latter under qemu-arm
    throw InputError(file_.device +
                     ": does not say how far its axes go; add axis_range = [LOW, HIGH] to [events]");
  if (status == -EINVAL) throw InputError(file_.device + ": has not the axes that [events] names");
  if (status < 0)
    throw std::runtime_error(file_.device + ": " + std::strerror(-status) +
                             "; [remote] device: one of /dev/input/by-id, which the group input may read");
}

EventDevice::~EventDevice() { close(); }

void EventDevice::close() {
  let_go();
  events_close(&events_);
}

int EventDevice::open() {
  const int opened = events_open(&events_, file_.device.c_str());
  if (opened < 0) return opened;
  for (std::size_t i = 0; i < controls_.size(); ++i) {
    if (!file_.events[i].axis) continue;
    input_absinfo about{};
    const int known = events_axis(&events_, file_.events[i].code, &about);
    if (known < 0 && !file_.axis_range) {
      close();
      return known;
    }
    Control& axis = controls_[i];
    axis.low = file_.axis_range ? file_.axis_range->first : about.minimum;
    axis.high = file_.axis_range ? file_.axis_range->second : about.maximum;
    if (axis.high <= axis.low) {
      close();
      return -EINVAL;
    }
    axis.waiting = known < 0 || share(axis, about.value) != 0.0;
  }
  last_event_s_ = runtime::now_s();
  return 0;
}

/// Nothing is known of any control any more.
void EventDevice::let_go() {
  for (std::size_t i = 0; i < controls_.size(); ++i) {
    controls_[i].value = 0.0;
    controls_[i].waiting = file_.events[i].axis;
  }
}

double EventDevice::share(const Control& axis, int raw) {
  const double middle = 0.5 * (static_cast<double>(axis.low) + axis.high);
  const double x = std::clamp((raw - middle) / (axis.high - middle), -1.0, 1.0);
  return std::copysign(std::max(0.0, std::abs(x) - kDeadZone) / (1.0 - kDeadZone), x);
}

void EventDevice::move(Control* axis, int raw) const {
  const double x = share(*axis, raw);
  if (x == 0.0) axis->waiting = false;
  axis->value = axis->waiting ? 0.0 : x;
}

void EventDevice::take(const input_event& event, Hand* hand) {
  if (event.type == EV_SYN && event.code == SYN_DROPPED) let_go();  // a release may be among what was lost
  if (event.type != EV_KEY && event.type != EV_ABS) return;
  for (std::size_t i = 0; i < controls_.size(); ++i) {
    const EventBinding& binding = file_.events[i];
    if (binding.axis != (event.type == EV_ABS) || binding.code != event.code) continue;
    if (binding.axis) {
      move(&controls_[i], event.value);
      continue;
    }
    constexpr int kReleased = 0;
    constexpr int kPressed = 1;  // 2: the kernel repeats a key that is held
    if (event.value == kReleased) controls_[i].value = 0.0;
    if (event.value != kPressed) continue;
    controls_[i].value = 1.0;
    hand->arm |= binding.action == HandAction::kArm;
    hand->disarm |= binding.action == HandAction::kDisarm;
    hand->heading_reset |= binding.action == HandAction::kHeadingReset;
    if (binding.action == HandAction::kStop) let_go();
  }
}

Hand EventDevice::look(int milliseconds) {
  Hand hand;
  if (events_.fd < 0 && open() < 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    hand.present = false;
    return hand;
  }
  (void)events_wait(&events_, milliseconds);
  constexpr int kAtMost = 256;  // whoever floods does not keep us from the clock
  for (int i = 0; i < kAtMost; ++i) {
    input_event event{};
    const int status = events_next(&events_, &event);
    if (status == -EAGAIN) break;
    if (status < 0) {
      close();
      hand.arm = false;
      hand.present = false;
      return hand;
    }
    last_event_s_ = runtime::now_s();
    take(event, &hand);
  }
  hand.heard = runtime::now_s() - last_event_s_ <= file_.hold_s;
  if (!hand.heard) return hand;
  std::array<double, kHandActions.size()> sum{};
  for (std::size_t i = 0; i < controls_.size(); ++i)
    sum[index_of(file_.events[i].action)] += file_.events[i].sign * controls_[i].value;
  const auto of = [&](HandAction plus, HandAction minus) {
    return std::clamp(sum[index_of(plus)] - sum[index_of(minus)], -1.0, 1.0);
  };
  hand.forward = of(HandAction::kForward, HandAction::kBack);
  hand.left = of(HandAction::kLeft, HandAction::kRight);
  hand.turn = of(HandAction::kTurnLeft, HandAction::kTurnRight);
  return hand;
}

}  // namespace equipoise::app
