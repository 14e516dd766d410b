// `equipoise send --live`: requests come in as lines while it runs, what the robot confirms goes out as JSON
// lines. Every motion is one signed command: who stops writing stops the motion by the robot's dead man.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <optional>
#include <sstream>
#include <vector>

#include "app/cli/interrupt.hpp"
#include "app/run/conversation.hpp"
#include "app/text/errors.hpp"
#include "app/text/json.hpp"
#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {

std::optional<LiveRequest> live_request(const std::string& line) {
  std::istringstream words(line);
  std::string what;
  std::string more;
  words >> what;
  LiveRequest request;
  if (what == "drive") {
    auto& motion = request.motion;
    double yaw_hz = 0.0;
    words >> motion.velocity_W_m_s[0] >> motion.velocity_W_m_s[1] >> yaw_hz;
    motion.yaw_rate_rad_s = 2.0 * kPi * yaw_hz;
    // The command line's ranges.
    const bool in_range = std::abs(motion.velocity_W_m_s[0]) <= 2.0 &&
                          std::abs(motion.velocity_W_m_s[1]) <= 2.0 && std::abs(yaw_hz) <= 5.0;
    if (words.fail() || !in_range) return std::nullopt;
    request.action = signed_command_t::DRIVE;
  } else if (what == "arm") {
    request.action = signed_command_t::ARM;
  } else if (what == "disarm") {
    request.action = signed_command_t::DISARM;
  } else if (what == "heading-reset") {
    request.action = signed_command_t::HEADING_RESET;
  } else if (what == "take") {
    request.action = signed_command_t::ASK;
  } else {
    return std::nullopt;
  }
  if (words >> more) return std::nullopt;
  return request;
}

namespace {

/// Whole lines from a descriptor, without waiting.
class Lines {
 public:
  explicit Lines(int fd) : fd_(fd) {}

  std::optional<std::string> next() {
    std::size_t end = text_.find('\n');
    if (end == std::string::npos) {
      read();
      end = text_.find('\n');
    }
    if (end == std::string::npos) return std::nullopt;
    std::string line = text_.substr(0, end);
    text_.erase(0, end + 1);
    return line;
  }
  bool ended() const { return ended_; }

 private:
  void read() {
    pollfd ready{fd_, POLLIN, 0};
    if (ended_ || poll(&ready, 1, 0) <= 0) return;
    std::array<char, 4096> bytes{};
    const ssize_t count = ::read(fd_, bytes.data(), bytes.size());
    if (count > 0) text_.append(bytes.data(), static_cast<std::size_t>(count));
    constexpr std::size_t kLongestLine = 1 << 16;
    ended_ = count == 0 || (count < 0 && errno != EINTR) || text_.size() > kLongestLine;
  }

  int fd_;
  std::string text_;
  bool ended_ = false;
};

const char* word(std::int8_t state) {
  constexpr std::array<const char*, 4> kWords{"off", "waiting", "armed", "fault"};  // of command_session_t
  const auto i = static_cast<std::uint8_t>(state);
  return i < kWords.size() ? kWords[i] : kWords[0];
}

}  // namespace

void Conversation::relay(int requests) {
  using runtime::now_s;
  Lines lines(requests);
  std::int64_t turn = robot().turn;  // in which whoever writes the lines decides
  constexpr std::int8_t kNone = signed_command_t::ASK;
  std::int8_t wish = kNone;  // arm, disarm or heading reset, repeated until a turn begins
  std::int64_t wish_turn = 0;
  std::int64_t wish_first = 0;
  double wish_ends_s = 0.0;
  std::optional<runtime::CommandSender::Motion> motion;  // the newest of this turn, not yet sent
  double next_s = 0.0;
  std::int64_t heard_ms = robot().heard_ms;
  double heard_at_s = now_s();
  nlohmann::json told;

  const auto decide = [&](std::int8_t action) {
    wish = action;
    wish_turn = robot().turn;
    wish_first = robot().signed_up_to + 1;
    wish_ends_s = now_s() + a_.timeout_s;
    motion.reset();
  };
  const auto tell = [&](const nlohmann::json& what) {
    if (what == told) return;
    told = what;
    std::printf("%s\n", what.dump().c_str());
    std::fflush(stdout);
  };

  const auto read_requests = [&lines](std::vector<LiveRequest>* requested) {
    while (const auto line = lines.next()) {
      const auto request = live_request(*line);
      if (!request)
        throw InputError("--live: '" + *line +
                         "': expected arm, disarm, heading-reset, take, or drive FORWARD LEFT YAW in m/s, "
                         "m/s, turns/s");
      requested->push_back(*request);
    }
  };
  /// What was asked before this process went on is void, but for a disarm; also what it has not read yet.
  const auto void_if_late = [&](std::vector<LiveRequest>* requested) {
    if (stopped_s_ <= kStopped_s) return;
    read_requests(requested);
    std::fprintf(stderr, "equipoise: was stopped for %.1f s: what was asked before is void\n", stopped_s_);
    stopped_s_ = 0.0;
    if (wish != signed_command_t::DISARM) wish = kNone;
    motion.reset();
    requested->erase(
        std::remove_if(requested->begin(), requested->end(),
                       [](const LiveRequest& r) { return r.action != signed_command_t::DISARM; }),
        requested->end());
  };

  const auto disarming = [&] { return wish == signed_command_t::DISARM && now_s() < wish_ends_s; };
  while ((!lines.ended() || disarming()) && !interrupted.load()) {
    std::vector<LiveRequest> requested;
    read_requests(&requested);
    listen(0.0);  // and sees whether it was stopped
    if (sender_.links().size() > 1) fail("has started anew, or there are two of that name");
    if (robot().heard_ms != heard_ms || stopped_s_ > kStopped_s) heard_at_s = now_s();
    heard_ms = robot().heard_ms;
    if (now_s() > heard_at_s + a_.timeout_s) fail("no longer answers");
    void_if_late(&requested);
    for (const LiveRequest& request : requested) {
      if (request.action == signed_command_t::DRIVE) {
        if (robot().turn == turn) motion = request.motion;
      } else if (request.action == signed_command_t::ASK) {
        turn = robot().turn;
      } else if (wish != signed_command_t::DISARM || request.action == signed_command_t::DISARM) {
        decide(request.action);
      }
    }
    if (wish != kNone && robot().turn != wish_turn) {
      const bool ours = sender_.began_turn(robot(), wish_first);
      if (ours) turn = robot().turn;
      // Whoever disarms wants it off: an arm in between is answered by the next disarm.
      if (!ours && wish == signed_command_t::DISARM)
        decide(wish);
      else
        wish = kNone;
    }
    // A late arm surprises; a disarm never comes too late.
    if (wish != kNone && wish != signed_command_t::DISARM && now_s() > wish_ends_s) wish = kNone;
    note_awake();
    if (stopped_s_ > kStopped_s) continue;
    if (now_s() >= next_s && (wish != kNone || (motion && robot().turn == turn))) {
      say(wish != kNone ? sender_.sign(&robot(), wish_turn, wish)
                        : sender_.sign(&robot(), turn, signed_command_t::DRIVE, *motion));
      if (wish == kNone) motion.reset();
      next_s = now_s() + wire_->interval_s();
    }
    tell({{"state", word(robot().state)},
          {"turn", robot().turn},
          {"mine", robot().turn == turn},
          {"holder", robot().turn_holder}});
  }
}

}  // namespace equipoise::app
