// A holder's side of the command protocol (docs/commands.md): which robot is there, and what it has
// confirmed. In: announcements -> out: signed messages. A robot counts as there when it has answered a
// question of this very run, for an announcement may be a recording. Not RT-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "equipoise/runtime/command_auth.hpp"

namespace equipoise::runtime {

class CommandSender {
 public:
  /// `robot`: empty: as in the keys. `holder`: of a robot's own keys only, else as in them.
  CommandSender(const CommandKeys& keys, const std::string& robot, const std::string& holder);

  /// One start of one robot, as it last answered.
  struct Link {
    std::int64_t session = 0;
    std::int64_t heard_ms = 0;
    std::int64_t turn = 0;
    std::int64_t turn_sender = 0;
    std::int64_t turn_sequence = 0;
    std::string turn_holder;
    std::int8_t state = 0;
    std::int64_t signed_up_to = 0;  // sequence of our last message
    std::int64_t confirmed = 0;     // and of the last that was taken
  };

  /// False: without proof, of another robot, or no news.
  bool hear(const command_session_t& announcement);
  /// A question to a robot that has been heard and has not answered yet; call until there is none.
  std::optional<signed_command_t> ask();
  /// Robots that are there, in the order of their answers.
  std::deque<Link>& links() { return links_; }
  bool deaf() const { return unproved_ > 0 && proved_ == 0; }  // robots are heard, but with other keys

  struct Motion {
    double velocity_W_m_s[2];
    double yaw_rate_rad_s;
  };
  /// `turn`: in which it was decided.
  signed_command_t sign(Link* to, std::int64_t turn, std::int8_t action, const Motion& motion = {});
  /// The turn was begun by one of our messages, this one or a later.
  bool began_turn(const Link& link, std::int64_t first_sequence) const {
    return link.turn_sender == id_ && link.turn_sequence >= first_sequence;
  }

 private:
  struct Candidate {
    Link link;  // as far as it is known
    bool asked = false;
  };
  static constexpr std::size_t kCandidates =
      64;  // recordings of old starts must not crowd out the present one

  bool consider(const command_session_t& announcement);
  bool follow(const command_session_t& announcement, Link* link);
  bool answers(const command_session_t& announcement, const Link& link) const;

  CommandKeys keys_;
  std::string robot_;
  std::string holder_;
  std::int64_t id_ = 0;
  std::vector<Candidate> candidates_;
  std::deque<Link> links_;  // who holds a reference keeps it
  std::size_t next_ = 0;    // candidate to be given up when there are too many
  std::int64_t proved_ = 0;
  std::int64_t unproved_ = 0;
};

}  // namespace equipoise::runtime
