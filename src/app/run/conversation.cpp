#include "app/run/conversation.hpp"

#include <unistd.h>

#include <fstream>
#include <sstream>

#include "app/cli/interrupt.hpp"
#include "app/run/wires.hpp"
#include "app/text/format.hpp"
#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {
namespace {

using runtime::now_s;

double after(double seconds) { return now_s() + seconds; }

/// When somebody asked for this process.
double process_start_s() {
  std::ifstream file("/proc/self/stat");
  std::string text;
  std::getline(file, text);
  std::istringstream fields(text.substr(std::min(text.rfind(')') + 1, text.size())));
  std::string field;
  constexpr int kStartTime = 20;  // the 22nd of all, in clock ticks since the machine's start
  for (int i = 0; i < kStartTime; ++i) fields >> field;
  return fields ? std::stod(field) / static_cast<double>(sysconf(_SC_CLK_TCK)) : now_s();
}

}  // namespace

Conversation::Conversation(const SendArguments& a, const runtime::CommandKeys& keys)
    : a_(a),
      awake_s_(process_start_s() + std::max(0.0, a.timeout_s - kStopped_s)),  // a busy machine starts it late
      sender_(keys, a.robot, a.holder),
      robot_(a.robot.empty() ? keys.robot() : a.robot),
      wire_(open_wire(a.url, runtime::WireSide::kOwner)) {}

void Conversation::listen(double seconds) {
  constexpr int kPatience_ms = 10;
  const double end = after(seconds);
  do {
    note_awake();
    wire_->listen(kPatience_ms, [this](const std::uint8_t* data, std::size_t size) {
      command_session_t heard;
      const auto length = static_cast<int>(size);
      if (heard.decode(data, 0, length) == length) sender_.hear(heard);
    });
    note_awake();
    while (const auto question = sender_.ask()) say(*question);
  } while (now_s() < end && !interrupted.load());
}

/// And a while longer: a second one of the same name and key must not go unnoticed.
void Conversation::find_robots() {
  for (const double limit = after(a_.timeout_s); sender_.links().empty(); listen(0.0)) {
    if (now_s() < limit && !interrupted.load()) continue;
    if (sender_.deaf())
      throw std::runtime_error("a robot answers on " + a_.url +
                               ", but it has not the same key; has that been rotated?");
    fail("does not answer on " + a_.url + " (it needs equipoise run --command-key FILE)");
  }
  if (a_.disarm) return;  // at once
  listen(kOthers_s);
  if (sender_.links().size() > 1)
    throw std::runtime_error("two robots with this key answer as " + robot_ +
                             ": give each its own (equipoise run --robot-name, or keygen)");
}

void Conversation::note_awake() {
  const double now = now_s();
  stopped_s_ = std::max(stopped_s_, now - awake_s_);
  awake_s_ = now;
}

void Conversation::refuse_if_late(std::int8_t action) const {
  if (action == signed_command_t::DISARM || stopped_s_ <= kStopped_s) return;
  throw std::runtime_error(
      format("this command was stopped for %.2g s; it would come too late: give it again", stopped_s_));
}

/// One arm, disarm or heading reset of the turn that is now, repeated until the robot has begun the next.
/// False: somebody else was faster.
bool Conversation::begin_turn(Link* link, std::int8_t action) {
  const std::int64_t turn = link->turn;
  const std::int64_t first = link->signed_up_to + 1;
  for (const double limit = after(a_.timeout_s); link->turn == turn;) {
    if (now_s() > limit || interrupted.load()) fail("confirms nothing");
    listen(0.0);
    refuse_if_late(action);
    if (link->turn != turn) break;
    say(sender_.sign(link, turn, action));
    for (const double next = after(wire_->interval_s()); now_s() < next && link->turn == turn;) listen(0.0);
  }
  return sender_.began_turn(*link, first);
}

void Conversation::begin_turn(std::int8_t action, const char* what) {
  if (!begin_turn(&robot(), action)) fail("did not " + std::string(what) + ": " + overtaken(robot()));
}

void Conversation::wait_until_armed() {
  const std::int64_t turn = robot().turn;
  for (const double limit = after(a_.timeout_s); robot().state != command_session_t::ARMED; listen(0.0)) {
    if (robot().turn != turn) fail("did not arm: " + overtaken(robot()));
    if (robot().state != command_session_t::WAITING || now_s() > limit)
      fail("does not arm; its log, its LEDs and equipoise doctor say why");
  }
}

/// Whoever disarms wants it off: an arm in between is answered by the next disarm. Of two robots with one
/// name and key, both.
void Conversation::disarm_all() {
  const double others = after(kOthers_s);
  const double limit = after(a_.timeout_s);
  for (std::size_t i = 0; i < sender_.links().size() || now_s() < others;) {
    if (i == sender_.links().size()) {
      listen(0.0);
      continue;
    }
    const bool ours = begin_turn(&sender_.links()[i], signed_command_t::DISARM);
    while (ours && sender_.links()[i].state == command_session_t::WAITING && now_s() < limit) listen(0.0);
    if (sender_.links()[i].state == command_session_t::OFF) {
      ++i;
    } else if (now_s() > limit) {
      fail("has taken the disarm, but its motors are not off");
    }
  }
}

std::int64_t Conversation::drive() {
  const std::int64_t turn = robot().turn;
  const runtime::CommandSender::Motion motion{{a_.drive_mps, a_.sideways_mps}, 2.0 * kPi * a_.yaw_hz};
  const double end = after(a_.duration_s);
  double silent = after(a_.timeout_s);
  for (std::int64_t sent = 1;; ++sent) {
    const std::int64_t confirmed = robot().confirmed;
    refuse_if_late(signed_command_t::DRIVE);
    say(sender_.sign(&robot(), turn, signed_command_t::DRIVE, motion));
    listen(wire_->interval_s());
    const bool last = now_s() >= end || interrupted.load();
    for (const double limit = after(kAnswer_s); last && confirms_more(); listen(0.0)) {
      if (now_s() > limit) break;  // one was lost: say it again
    }
    if (robot().turn != turn) fail("drives no more as told: " + overtaken(robot()));
    if (robot().confirmed > confirmed) silent = after(a_.timeout_s);
    if (last && !confirms_more()) return sent;
    if (now_s() > silent) fail("took none or not all of " + std::to_string(sent) + " commands");
  }
}

}  // namespace equipoise::app
