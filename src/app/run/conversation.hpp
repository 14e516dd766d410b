// A holder's conversation with one robot over one wire: it asks, repeats and believes only what the robot
// confirms. In: arguments, key, wire -> out: a request done, or runtime_error saying why not. Not RT-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "equipoise/runtime/command_sender.hpp"
#include "equipoise/runtime/command_wire.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {

struct LiveRequest {
  std::int8_t action = signed_command_t::ASK;  // ASK: take the turn that is now as one's own
  runtime::CommandSender::Motion motion{};     // of DRIVE
};

/// m/s, m/s, turns per second, within the ranges of --drive-mps and --yaw-hz; nothing for any other line.
std::optional<LiveRequest> live_request(const std::string& line);

struct SendArguments {
  std::string key;
  std::string url = runtime::kDefaultTelemetryUrl;
  std::string robot;
  std::string holder;
  double drive_mps = 0.0;
  double sideways_mps = 0.0;
  double yaw_hz = 0.0;
  double duration_s = 0.2;
  double timeout_s = 2.0;
  bool arm = false;
  bool disarm = false;
  bool heading_reset = false;
  bool drive = false;
  bool live = false;
};

class Conversation {
 public:
  Conversation(const SendArguments& a, const runtime::CommandKeys& keys);

  void find_robots();
  void disarm_all();
  void begin_turn(std::int8_t action, const char* what);
  void wait_until_armed();
  std::int64_t drive();
  void relay(int requests);

 private:
  using Link = runtime::CommandSender::Link;

  void listen(double seconds);
  void say(const signed_command_t& m) { wire_->say(runtime::encoded(m)); }
  bool begin_turn(Link* link, std::int8_t action);
  Link& robot() { return sender_.links().front(); }
  bool confirms_more() { return robot().confirmed < robot().signed_up_to; }
  void note_awake();
  void refuse_if_late(std::int8_t action) const;
  [[noreturn]] void fail(const std::string& what) const { throw std::runtime_error(robot_ + " " + what); }
  std::string overtaken(const Link& link) const {
    return (link.turn_holder.empty() ? "somebody" : link.turn_holder) + " has taken over";
  }

  /// Twice the command_timeout_s that robots are shipped with. Who was stopped for longer, a terminal's
  /// Ctrl-Z or a suspended machine, does not know any more what is wanted of it, but for a disarm.
  static constexpr double kStopped_s = 1.0;
  static constexpr double kAnswer_s = 0.5;   // on the slowest wire
  static constexpr double kOthers_s = 0.25;  // for every robot there to have answered

  const SendArguments& a_;
  double awake_s_;          // last known to run; at first, when the process was started
  double stopped_s_ = 0.0;  // the longest that it was not
  runtime::CommandSender sender_;
  std::string robot_;
  std::unique_ptr<runtime::CommandWire> wire_;
};

}  // namespace equipoise::app
