// Commands from a wire, judged on a thread of their own and handed to the tick without locks.
// In: the robot's keys, wire -> out: the newest command and its age; announcements on the wire. Nothing else
// is ever listened to. latest() and tell() are RT-safe: they read a vDSO clock and atomics.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "equipoise/runtime/command_auth.hpp"
#include "equipoise/runtime/command_follower.hpp"
#include "equipoise/runtime/command_wire.hpp"
#include "equipoise/runtime/latest_value.hpp"
#include "equipoise/runtime/remote.hpp"

namespace equipoise::runtime {

struct CommandReceiverOptions {
  std::string robot;  // its name; empty: as in the keys
  double timeout_s = 0.5;
  /// Told on the receiver's thread, which must not be held up, who began which turn.
  std::function<void(const std::string& what)> journal;
};

class CommandReceiver final : public Remote {
 public:
  CommandReceiver(const CommandKeys& keys, const CommandReceiverOptions& options,
                  std::unique_ptr<CommandWire> wire);
  ~CommandReceiver() override;

  Command latest() noexcept override;
  void tell(ArmState state) noexcept override;

 private:
  double now_ms() const noexcept;
  void run();
  void receive(const std::uint8_t* data, std::size_t size);
  void announce(std::int64_t to);
  void note(const signed_command_t& message) const;

  const std::int64_t started_ns_;
  std::function<void(const std::string&)> journal_;
  CommandGate gate_;  // these two: the thread's alone
  std::unique_ptr<CommandWire> wire_;
  LatestValue<CommandWish> wish_;
  CommandFollower follower_;               // the loop's alone
  std::atomic<std::int64_t> followed_{0};  // four times the turn, and the motors' state in it
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace equipoise::runtime
