#include "equipoise/runtime/command_sender.hpp"

#include <sodium.h>

#include <algorithm>
#include <iterator>

namespace equipoise::runtime {

CommandSender::CommandSender(const CommandKeys& keys, const std::string& robot, const std::string& holder)
    : keys_(keys.holder().empty() ? keys.of_holder(holder.empty() ? "owner" : holder) : keys),
      robot_(robot.empty() ? keys.robot() : robot),
      holder_(keys_.holder()) {
  (void)keys_.commands(holder.empty() ? holder_ : holder);  // says so when the keys are another's
  while (id_ == 0) randombytes_buf(&id_, sizeof id_);
}

bool CommandSender::hear(const command_session_t& a) {
  if (!authentic(keys_, a)) {
    ++unproved_;
    return false;
  }
  ++proved_;
  if (name_in(a.robot) != robot_ || a.clock_ms < 0) return false;
  const auto linked =
      std::find_if(links_.begin(), links_.end(), [&](const Link& l) { return l.session == a.session; });
  if (linked == links_.end()) return consider(a);
  return follow(a, &*linked);
}

bool CommandSender::follow(const command_session_t& a, Link* link_of_it) {
  Link& link = *link_of_it;
  if (a.clock_ms < link.heard_ms || a.turn < link.turn) return false;  // a recording
  link.heard_ms = a.clock_ms;
  link.turn = a.turn;
  link.turn_sender = a.turn_sender;
  link.turn_sequence = a.turn_sequence;
  link.turn_holder = name_in(a.turn_holder);
  link.state = a.state;
  if (answers(a, link)) link.confirmed = a.sequence;
  return true;
}

bool CommandSender::answers(const command_session_t& a, const Link& link) const {
  return a.to == id_ && a.sequence > link.confirmed && a.sequence <= link.signed_up_to;
}

/// True when it is an answer, and the robot there.
bool CommandSender::consider(const command_session_t& a) {
  const auto known = std::find_if(candidates_.begin(), candidates_.end(),
                                  [&](const Candidate& c) { return c.link.session == a.session; });
  if (known == candidates_.end()) {
    Candidate heard;
    heard.link.session = a.session;
    heard.link.heard_ms = a.clock_ms;
    if (candidates_.size() < kCandidates) {
      candidates_.push_back(heard);
    } else {
      candidates_[next_++ % kCandidates] = heard;
    }
    return false;
  }
  if (a.clock_ms >= known->link.heard_ms && answers(a, known->link)) {
    links_.push_back(known->link);
    candidates_.erase(known);
    return follow(a, &links_.back());
  }
  if (a.clock_ms > known->link.heard_ms) {
    known->link.heard_ms = a.clock_ms;
    known->asked = false;
  }
  return false;
}

std::optional<signed_command_t> CommandSender::ask() {
  const auto next =
      std::find_if(candidates_.begin(), candidates_.end(), [](const Candidate& c) { return !c.asked; });
  if (next == candidates_.end()) return std::nullopt;
  next->asked = true;
  return sign(&next->link, 0, signed_command_t::ASK);
}

signed_command_t CommandSender::sign(Link* to, std::int64_t turn, std::int8_t action, const Motion& motion) {
  signed_command_t m{};
  m.session = to->session;
  m.heard_ms = to->heard_ms;
  m.sender = id_;
  m.sequence = ++to->signed_up_to;
  m.turn = turn;
  m.action = action;
  std::copy(std::begin(motion.velocity_W_m_s), std::end(motion.velocity_W_m_s), m.velocity_W_m_s);
  m.yaw_rate_rad_s = motion.yaw_rate_rad_s;
  set_name(holder_, &m.holder);
  runtime::sign(keys_, robot_, &m);
  return m;
}

}  // namespace equipoise::runtime
