// A device in a hand as a remote: read on a thread of its own, handed to the tick without locks. In: what the
// hand does -> out: Command; on stderr who asks for the motors. Requests expire as a signed one's do. Nothing
// here is signed: whoever has the device commands.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "app/remote/remote_file.hpp"
#include "equipoise/runtime/command_follower.hpp"
#include "equipoise/runtime/latest_value.hpp"
#include "equipoise/runtime/remote.hpp"

namespace equipoise::app {

/// Before anything moves, everything is let go once: after the start, after arming and after disarming.
class HandGate {
 public:
  /// Also at most full speed on the diagonal.
  Hand limit(const Hand& hand) noexcept;

 private:
  bool must_let_go_ = true;
};

/// A device of the file's kind, open.
std::unique_ptr<HandDevice> open_hand(const RemoteFile& file);

class HandRemote final : public runtime::Remote {
 public:
  struct Options {
    double speed_m_s = 0.1;  // at full deflection
    double turn_hz = 0.25;
    double timeout_s = 0.5;  // safety.command_timeout_s
    std::function<void(const std::string&)> journal{};
  };

  HandRemote(std::unique_ptr<HandDevice> device, Options options);
  ~HandRemote() override;

  Command latest() noexcept override;
  void tell(ArmState state) noexcept override { follower_.tell(state); }

 private:
  void run();

  const Options options_;
  std::unique_ptr<HandDevice> device_;
  runtime::LatestValue<runtime::CommandWish> wish_;
  runtime::CommandFollower follower_;  // the loop's alone
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace equipoise::app
