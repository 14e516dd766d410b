// The body of replay_log(), for one robot: its log through the production loop and pipeline. In: log -> out:
// Replay. Included where a list of robots is at hand.
#pragma once

#include <cerrno>
#include <cmath>
#include <cstring>
#include <exception>
#include <optional>

#include "app/cli/commands.hpp"
#include "app/log/replay.hpp"
#include "app/run/firmware.hpp"
#include "equipoise/runtime/fields.hpp"
#include "equipoise/runtime/loop.hpp"

namespace equipoise::app {

inline std::uint64_t bits(double value) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

/// What the tick computed; the rest went into it, or is about the loop.
template <class Message>
constexpr bool kComputed =
    std::is_same_v<Message, runtime::fields::State> || std::is_same_v<Message, runtime::fields::Motors> ||
    std::is_same_v<Message, runtime::fields::Health>;

/// number(channel, field, index or -1, value) for each number that the tick computed, in the order of the
/// tick.
template <class Number>
void each_computed(const runtime::TickRecord& r, Number&& number) {
  runtime::fields::each_message(r, [&](auto message, const char* channel, const auto& record) {
    if constexpr (kComputed<decltype(message)>) {
      decltype(message)::visit(record, [&](const char* field, const char*, const auto& value) {
        if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) {
          number(channel, field, -1, static_cast<double>(value));
        } else {
          int i = 0;
          for (const double element : value) number(channel, field, i++, element);
        }
      });
    }
  });
}

/// Bit for bit, but any NaN is any other.
inline void compare(const runtime::TickRecord& logged, const runtime::TickRecord& replayed,
                    Difference* difference) {
  if (difference->found) return;
  std::vector<double> expected;
  each_computed(logged, [&](const char*, const char*, int, double value) { expected.push_back(value); });
  std::size_t at = 0;
  each_computed(replayed, [&](const char* channel, const char* field, int i, double value) {
    const double was = expected[at++];
    if (difference->found || bits(was) == bits(value) || (std::isnan(was) && std::isnan(value))) return;
    const std::string index = i < 0 ? "" : "[" + std::to_string(i) + "]";
    *difference = {true, logged.tick, std::string(channel) + "." + field + index, was, value};
  });
}

/// What the simulation knew, from what it logged; false for a robot whose log does not hold all of it.
template <class Estimate>
bool recall(const runtime::StateRecord&, Estimate*) noexcept {
  return false;
}
inline bool recall(const runtime::StateRecord& s, MbbrEstimate* truth) noexcept {
  truth->theta_xy = Vec2(s.theta_rad[0], s.theta_rad[1]);
  truth->theta_z = s.theta_rad[2];
  truth->omega_B = Vec3(s.omega_B_rad_s[0], s.omega_B_rad_s[1], s.omega_B_rad_s[2]);
  truth->theta_dot = euler_rates(truth->theta_xy, truth->omega_B);
  truth->phi_dot_star = Vec2(s.phi_dot_rad_s[0], s.phi_dot_rad_s[1]);
  truth->phi = Vec2(s.phi_rad[0], s.phi_rad[1]);
  return true;
}

/// The log as a hardware boundary: its samples, one per tick; motor commands go nowhere.
class LoggedIo {
 public:
  explicit LoggedIo(RunLog& log) : log_(log) {}

  int wait_tick(std::int64_t* now_ns) noexcept {
    try {
      if (!log_.next(&now_)) return -ESHUTDOWN;
    } catch (...) {
      failure_ = std::current_exception();
      return -EIO;
    }
    *now_ns = now_.now_ns;
    return 0;
  }
  /// Why the log could not be read on, if it could not.
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }
  RawSample read() noexcept { return now_.raw; }
  int write(const MotorCommand& /*command*/) noexcept { return 0; }
  int motors_off() noexcept { return 0; }

  const runtime::TickRecord& now() const noexcept { return now_; }

 private:
  RunLog& log_;
  runtime::TickRecord now_{};
  std::exception_ptr failure_;
};

/// What the runtime held against the motors, then.
class LoggedSupervisor {
 public:
  explicit LoggedSupervisor(const LoggedIo& io) : io_(io) {}
  std::uint32_t begin(std::int64_t /*now_ns*/, const RawSample& /*raw*/) noexcept {
    return io_.now().inhibit;
  }
  void end(bool /*driven*/, int /*write_error*/) noexcept {}

 private:
  const LoggedIo& io_;
};

/// As the run judged it.
inline VerdictJudge::Tick judged(const runtime::TickRecord& r) noexcept {
  const double tilt_rad = r.has_truth ? std::hypot(r.truth.theta_rad[0], r.truth.theta_rad[1]) : std::nan("");
  const double simulated_s = 1e-9 * static_cast<double>(r.now_ns);
  return {r.has_truth ? simulated_s : static_cast<double>(r.tick) * kTickS, r.arm, r.enable, r.reasons,
          tilt_rad};
}

template <class Pipeline>
Replay replay(RunLog& log, Pipeline& pipeline, std::optional<std::size_t> other) {
  constexpr std::int64_t kSettled = 1000;  // ticks, 5 s
  Replay out;
  LoggedIo io(log);
  LoggedSupervisor supervisor(io);
  runtime::TickRecord record{};
  std::int64_t expected = 0;
  VerdictJudge judge;
  const std::atomic<bool> never{false};
  const auto commands = [&](std::int64_t, std::int64_t) {
    decltype(Pipeline::Result::x_hat) known;
    if (io.now().has_truth && recall(io.now().truth, &known)) pipeline.estimators().observe_truth(known);
    return command_of(io.now());
  };
  const auto on_tick = [&](std::int64_t, std::int64_t now_ns, const RawSample& raw, const Command& command,
                           const typename Pipeline::Result& result) {
    const runtime::TickRecord& tick = io.now();
    out.missing += tick.tick - expected;
    expected = tick.tick + 1;
    record_tick(tick.tick, now_ns, raw, command, result, pipeline, &record);
    compare(tick, record, &out.difference);
    judge.observe(judged(tick));
    if (!tick.has_truth || tick.tick < kSettled) return;
    out.logged.add(tick.estimate, tick.truth);
    if (other) out.other.add(record.others[*other], tick.truth);
  };
  out.ticks = runtime::run_loop(io, pipeline, commands, on_tick, never, supervisor).ticks;
  io.rethrow();
  out.verdict = judge.verdict(false, false);
  out.incomplete = log.incomplete_ticks();
  out.damaged_bytes = log.damaged_bytes();
  return out;
}

template <class Firmware>
std::optional<std::size_t> index_of(const std::string& estimator) {
  const std::vector<std::string> names = Firmware::estimators();
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == estimator) return i;
  }
  return std::nullopt;
}

/// As replay_log(), of this robot's log.
template <class Firmware>
Replay replay_as(RunLog& log, const std::string& origin, const std::string& other) {
  const runtime::RunInfo& info = log.run();
  Choice choice{info.estimator, info.controller, info.fidelity, false, info.attitude, info.backend};
  complete<Firmware>(choice);
  if (!other.empty()) {
    Choice asked{other, info.controller, "", false, ""};
    complete<Firmware>(asked);
    choice.compare = true;
  }
  const auto loaded = Firmware::parse(info.config_toml, origin + " (its configuration)");
  const auto config = Firmware::apply(loaded.config, choice);
  const std::optional<std::size_t> index = index_of<Firmware>(other);
  Replay r = Firmware::with_pipeline(config, choice.controller,
                                     [&](auto& pipeline) { return replay(log, pipeline, index); });
  if (r.ticks == 0) throw InputError(origin + ": holds no whole tick");
  return r;
}

}  // namespace equipoise::app
