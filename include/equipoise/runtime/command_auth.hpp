// The robot's side of the command protocol (docs/commands.md): which message counts, and for what.
// In: signed_command_t, the robot's own clock -> out: what is asked for now (CommandWish), announcements.
// Freshness without comparing clocks: a command repeats the clock value of the announcement it answers.
// Not for the tick.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "equipoise/command_session_t.hpp"
#include "equipoise/runtime/command_key.hpp"
#include "equipoise/signed_command_t.hpp"

namespace equipoise::runtime {

/// With the keys of the robot or of one holder.
void sign(const CommandKeys& keys, const std::string& robot, signed_command_t* message);
bool authentic(const CommandKeys& keys, const std::string& robot, const signed_command_t& message);
void sign(const CommandKeys& keys, command_session_t* announcement);
bool authentic(const CommandKeys& keys, const command_session_t& announcement);

/// Names in messages; "" when it is none.
std::string name_in(const std::uint8_t (&bytes)[CommandKeys::kLongestName]);
void set_name(const std::string& name, std::uint8_t (*bytes)[CommandKeys::kLongestName]);

/// What the obeyed commands come to. Times in ms of the robot's clock.
struct CommandWish {
  std::int64_t turn = 0;
  std::int64_t arms = 0;
  std::int64_t disarms = 0;
  std::int64_t heading_resets = 0;
  bool arm = false;
  std::int64_t arm_until_ms = 0;  // not armed by then: too late
  std::int64_t heard_ms = 0;      // clock that the newest obeyed command answers
  double velocity_W_m_s[2] = {0.0, 0.0};
  double yaw_rate_rad_s = 0.0;
};

class CommandGate {
 public:
  static constexpr std::int64_t kLargestJump = 1000;  // of a sender's sequence
  static constexpr std::size_t kSenders = 8;          // at the same time

  /// `keys`: the robot's. `robot`: its name, empty: as in the keys.
  CommandGate(const CommandKeys& keys, std::int64_t timeout_ms, const std::string& robot = "");

  enum class Verdict { kRefused, kTaken, kObeyed };  // kTaken: a question, or decided in an earlier turn
  Verdict accept(const signed_command_t& message, std::int64_t now_ms);

  const CommandWish& wish() const { return wish_; }
  /// Signed; `to`: the sender it answers. `state`: command_session_t's.
  command_session_t announcement(std::int64_t now_ms, std::int8_t state, std::int64_t to = 0) const;

 private:
  struct Sender {
    std::int64_t id = 0;
    std::int64_t sequence = 0;
    std::int64_t heard_ms = 0;
  };
  bool fresh(std::int64_t heard_ms, std::int64_t now_ms) const;
  Sender* place_of(std::int64_t id, std::int64_t now_ms);
  void obey(const signed_command_t& message);

  CommandKeys keys_;
  std::string robot_;
  std::int64_t timeout_ms_;
  command_session_t said_{};  // what does not change from announcement to announcement but by commands
  CommandWish wish_;
  std::array<Sender, kSenders> senders_{};
};

}  // namespace equipoise::runtime
