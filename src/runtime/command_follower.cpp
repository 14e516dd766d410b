#include "equipoise/runtime/command_follower.hpp"

namespace equipoise::runtime {

Command CommandFollower::update(const CommandWish& wish, double now_ms) noexcept {
  const bool asked_anew = wish.arms != arms_;
  const bool let_go = wish.disarms != disarms_ || (asked_anew && state_ == ArmState::kFault);
  if (asked_anew) asked_ = true;
  if (!wish.arm) asked_ = false;
  if (state_ == ArmState::kDisarmed && now_ms > static_cast<double>(wish.arm_until_ms)) asked_ = false;

  Command command;
  command.arm = asked_ && !let_go;
  command.velocity_W_m_s = Vec2(wish.velocity_W_m_s[0], wish.velocity_W_m_s[1]);
  command.yaw_rate_rad_s = wish.yaw_rate_rad_s;
  command.heading_reset = wish.heading_resets != heading_resets_;
  command.age_s = 1e-3 * (now_ms - static_cast<double>(wish.heard_ms));

  turn_ = wish.turn;
  arms_ = wish.arms;
  disarms_ = wish.disarms;
  heading_resets_ = wish.heading_resets;
  return command;
}

std::int8_t CommandFollower::state() const noexcept {
  if (state_ == ArmState::kArmed) return command_session_t::ARMED;
  if (state_ == ArmState::kFault) return command_session_t::FAULT;
  return asked_ ? command_session_t::WAITING : command_session_t::OFF;
}

}  // namespace equipoise::runtime
