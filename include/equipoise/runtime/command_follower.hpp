// From what is wished to what the tick is told: requests become the level that safety understands, and
// expire. In: CommandWish, the robot's clock, what safety made of the last tick -> out: Command. A request
// that has not armed the motors in time is forgotten, one in a fault or after a disarm first lets go.
// RT-safe.
#pragma once

#include "equipoise/actuate/safety.hpp"
#include "equipoise/runtime/command_auth.hpp"

namespace equipoise::runtime {

class CommandFollower {
 public:
  Command update(const CommandWish& wish, double now_ms) noexcept;
  /// After each tick.
  void tell(ArmState state) noexcept { state_ = state; }

  std::int64_t turn() const noexcept { return turn_; }  // newest that was followed
  std::int8_t state() const noexcept;                   // command_session_t's

 private:
  std::int64_t turn_ = 0;
  std::int64_t arms_ = 0;
  std::int64_t disarms_ = 0;
  std::int64_t heading_resets_ = 0;
  bool asked_ = false;
  ArmState state_ = ArmState::kDisarmed;
};

}  // namespace equipoise::runtime
