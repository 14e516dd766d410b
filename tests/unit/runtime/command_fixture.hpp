// A robot's gate and messages to it, without wires. Start-up only, tests.
#pragma once

#include <string>

#include "equipoise/runtime/command_auth.hpp"

namespace equipoise::runtime {

inline CommandKeys keys_of(std::uint8_t first, const std::string& robot = "mbbr") {
  CommandKey::Bytes bytes{};
  bytes[0] = first;
  return CommandKeys::of_robot(robot, CommandKey(bytes));
}

struct Asked {
  std::int64_t sequence = 1;
  std::int8_t action = signed_command_t::ARM;
  std::int64_t heard_ms = 1000;
  std::int64_t turn = 0;
  std::int64_t sender = 7;
  double forward_m_s = 0.25;
};

inline signed_command_t command_for(const CommandGate& gate, const CommandKeys& keys, const Asked& asked,
                                    const std::string& robot = "mbbr") {
  signed_command_t m{};
  m.session = gate.announcement(0, 0).session;
  m.heard_ms = asked.heard_ms;
  m.sender = asked.sender;
  m.sequence = asked.sequence;
  m.turn = asked.turn;
  m.action = asked.action;
  m.velocity_W_m_s[0] = asked.forward_m_s;
  m.yaw_rate_rad_s = -1.5;
  set_name("anna", &m.holder);
  sign(keys, robot, &m);
  return m;
}

}  // namespace equipoise::runtime
