// Signed commands from a wire, received on a thread of its own and handed to the tick without locks.
// In: key, wire -> out: the newest command and its age. Nothing else is ever listened to. latest() is
// RT-safe.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "equipoise/runtime/command_auth.hpp"
#include "equipoise/runtime/command_wire.hpp"
#include "equipoise/runtime/latest_command.hpp"
#include "equipoise/runtime/spsc_queue.hpp"

namespace equipoise::runtime {

class CommandReceiver {
 public:
  CommandReceiver(const CommandKey& key, std::unique_ptr<CommandWire> wire);
  ~CommandReceiver();
  CommandReceiver(const CommandReceiver&) = delete;
  CommandReceiver& operator=(const CommandReceiver&) = delete;

  /// Once per tick.
  Command latest(std::int64_t now_ns) noexcept;

 private:
  struct Plain {  // Command without Eigen
    double x, y, yaw_rate;
    bool arm, heading_reset;
  };
  void run();
  void receive(const std::uint8_t* data, std::size_t size);

  SpscQueue<Plain> queue_;
  CommandGate gate_;  // these two: the thread's alone
  std::unique_ptr<CommandWire> wire_;
  LatestCommand latest_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace equipoise::runtime
