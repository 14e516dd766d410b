#include "equipoise/runtime/command_auth.hpp"

#include <sodium.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "equipoise/runtime/command_wire.hpp"

namespace equipoise::runtime {
namespace {

static_assert(sizeof(signed_command_t::mac) == CommandKey::kMacBytes);
static_assert(sizeof(command_session_t::mac) == CommandKey::kMacBytes);
static_assert(sizeof(signed_command_t::holder) == CommandKeys::kLongestName);

/// What is proved: a name, NUL, and the message with zeros for its proof, which is its end.
std::vector<std::uint8_t> proved(const std::string& name, const std::vector<std::uint8_t>& message) {
  std::vector<std::uint8_t> bytes(name.begin(), name.end());
  bytes.push_back(0);
  bytes.insert(bytes.end(), message.begin(), message.end() - CommandKey::kMacBytes);
  bytes.resize(bytes.size() + CommandKey::kMacBytes);
  return bytes;
}

bool sensible(const signed_command_t& m) {
  return std::isfinite(m.velocity_W_m_s[0]) && std::isfinite(m.velocity_W_m_s[1]) &&
         std::isfinite(m.yaw_rate_rad_s) && m.action >= signed_command_t::ASK &&
         m.action <= signed_command_t::HEADING_RESET && m.sender != 0;
}

}  // namespace

std::string name_in(const std::uint8_t (&bytes)[CommandKeys::kLongestName]) {
  const std::string name(std::begin(bytes), std::find(std::begin(bytes), std::end(bytes), 0));
  return is_command_name(name) ? name : "";
}

void set_name(const std::string& name, std::uint8_t (*bytes)[CommandKeys::kLongestName]) {
  std::memset(*bytes, 0, sizeof *bytes);
  std::copy_n(name.begin(), std::min(name.size(), CommandKeys::kLongestName), *bytes);
}

void sign(const CommandKeys& keys, const std::string& robot, signed_command_t* message) {
  keys.commands(name_in(message->holder)).mac(proved(robot, encoded(*message)), message->mac);
}

bool authentic(const CommandKeys& keys, const std::string& robot, const signed_command_t& message) {
  const std::string holder = name_in(message.holder);
  return !holder.empty() && keys.commands(holder).proves(proved(robot, encoded(message)), message.mac);
}

void sign(const CommandKeys& keys, command_session_t* announcement) {
  keys.announcements().mac(proved("", encoded(*announcement)), announcement->mac);
}

bool authentic(const CommandKeys& keys, const command_session_t& announcement) {
  return keys.announcements().proves(proved("", encoded(announcement)), announcement.mac);
}

CommandGate::CommandGate(const CommandKeys& keys, std::int64_t timeout_ms, const std::string& robot)
    : keys_(keys), robot_(robot.empty() ? keys.robot() : robot), timeout_ms_(timeout_ms) {
  randombytes_buf(&said_.session, sizeof said_.session);
  set_name(robot_, &said_.robot);
}

bool CommandGate::fresh(std::int64_t heard_ms, std::int64_t now_ms) const {
  return heard_ms >= 0 && heard_ms <= now_ms && now_ms - heard_ms <= timeout_ms_;
}

/// A place is given to another only when all that its owner ever signed is too old to count.
CommandGate::Sender* CommandGate::place_of(std::int64_t id, std::int64_t now_ms) {
  const auto own =
      std::find_if(senders_.begin(), senders_.end(), [&](const Sender& s) { return s.id == id; });
  if (own != senders_.end()) return &*own;
  const auto free = std::find_if(senders_.begin(), senders_.end(),
                                 [&](const Sender& s) { return s.id == 0 || !fresh(s.heard_ms, now_ms); });
  return free == senders_.end() ? nullptr : &(*free = Sender{id, 0, 0});
}

CommandGate::Verdict CommandGate::accept(const signed_command_t& m, std::int64_t now_ms) {
  const auto refuse = [this] {
    if (said_.refused < INT32_MAX) ++said_.refused;
    return Verdict::kRefused;
  };
  if (m.session != said_.session || !fresh(m.heard_ms, now_ms) || !sensible(m) ||
      !authentic(keys_, robot_, m)) {
    return refuse();
  }
  Sender* const sender = place_of(m.sender, now_ms);
  // The difference cannot overflow: both are positive.
  if (sender == nullptr || m.sequence <= sender->sequence || m.sequence - sender->sequence > kLargestJump ||
      m.heard_ms < sender->heard_ms) {
    return refuse();
  }
  sender->sequence = m.sequence;
  sender->heard_ms = m.heard_ms;
  if (said_.accepted < INT32_MAX) ++said_.accepted;
  if (m.action == signed_command_t::ASK || m.turn != wish_.turn) return Verdict::kTaken;
  obey(m);
  return Verdict::kObeyed;
}

void CommandGate::obey(const signed_command_t& m) {
  wish_.heard_ms = m.heard_ms;
  const bool drive = m.action == signed_command_t::DRIVE;
  wish_.velocity_W_m_s[0] = drive ? m.velocity_W_m_s[0] : 0.0;  // no motion outlives its turn
  wish_.velocity_W_m_s[1] = drive ? m.velocity_W_m_s[1] : 0.0;
  wish_.yaw_rate_rad_s = drive ? m.yaw_rate_rad_s : 0.0;
  if (drive) return;
  ++wish_.turn;
  said_.turn = wish_.turn;
  said_.turn_sender = m.sender;
  said_.turn_sequence = m.sequence;
  std::copy(std::begin(m.holder), std::end(m.holder), said_.turn_holder);
  if (m.action == signed_command_t::HEADING_RESET) {
    ++wish_.heading_resets;
  } else if (m.action == signed_command_t::DISARM) {
    ++wish_.disarms;
    wish_.arm = false;
  } else {
    ++wish_.arms;
    wish_.arm = true;
    wish_.arm_until_ms = m.heard_ms + timeout_ms_;
  }
}

command_session_t CommandGate::announcement(std::int64_t now_ms, std::int8_t state, std::int64_t to) const {
  command_session_t out = said_;
  out.clock_ms = now_ms;
  out.state = state;
  out.to = to;
  const auto sender =
      std::find_if(senders_.begin(), senders_.end(), [&](const Sender& s) { return to != 0 && s.id == to; });
  out.sequence = sender == senders_.end() ? 0 : sender->sequence;
  sign(keys_, &out);
  return out;
}

}  // namespace equipoise::runtime
