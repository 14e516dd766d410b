// A gamepad or keyboard as a hand's device. In: the kernel's events -> out: Hand. Unplugged, its motion is
// void, and it is opened again when it is back; so it is when nothing at all comes for hold_s, because a
// wireless one that is out of range leaves its last stick behind. Not RT-safe.
#pragma once

#include <vector>

#include "app/remote/remote_file.hpp"
#include "events.h"

namespace equipoise::app {

class EventDevice final : public HandDevice {
 public:
  /// runtime_error or InputError when it cannot be used.
  explicit EventDevice(RemoteFile file);
  ~EventDevice() override;

  Hand look(int milliseconds) override;

  static constexpr double kDeadZone = 0.1;

 private:
  struct Control {
    double value = 0.0;    // -1 .. 1
    bool waiting = false;  // an axis whose past is unknown: void until it was seen at rest
    int low = -1, high = 1;
  };

  int open();
  void close();
  void let_go();
  void take(const input_event& event, Hand* hand);
  static double share(const Control& axis, int raw);
  void move(Control* axis, int raw) const;

  RemoteFile file_;
  std::vector<Control> controls_;  // as file_.events
  events_t events_{-1};
  double last_event_s_ = 0.0;
};

}  // namespace equipoise::app
