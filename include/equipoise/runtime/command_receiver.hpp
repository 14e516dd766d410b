// Signed commands over LCM, received on a thread of its own and handed to the tick without locks.
// In: key, LCM URL -> out: the newest command; half a second without one, velocities go to zero (the
// reference ramps them down) and the motors stay as they are. Nothing else is ever listened to. latest() is
// RT-safe.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "equipoise/runtime/command_auth.hpp"
#include "equipoise/runtime/spsc_queue.hpp"

namespace equipoise::runtime {

class CommandReceiver {
 public:
  static constexpr const char* kCommandChannel = "EQUIPOISE_SIGNED_COMMAND";
  static constexpr const char* kSessionChannel = "EQUIPOISE_COMMAND_SESSION";
  static constexpr int kTimeoutTicks = 100;

  /// Throws std::runtime_error when the URL cannot be opened.
  CommandReceiver(const CommandKey& key, const std::string& url);
  ~CommandReceiver();
  CommandReceiver(const CommandReceiver&) = delete;
  CommandReceiver& operator=(const CommandReceiver&) = delete;

  /// Once per tick.
  Command latest() noexcept;

 private:
  struct Plain {  // Command without Eigen
    double x, y, yaw_rate;
    bool arm, heading_reset;
  };
  class Link;
  void run();

  SpscQueue<Plain> queue_;
  std::unique_ptr<Link> link_;
  Command current_;
  int age_ticks_ = 0;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace equipoise::runtime
