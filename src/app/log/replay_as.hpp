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
#include "app/log/retuned.hpp"
#include "app/trial/firmware.hpp"
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

/// One logged tick after another as a hardware boundary, for a pipeline that follows the recorded run.
class HandedOverIo {
 public:
  void hand_over(const runtime::TickRecord& tick) noexcept { now_ = &tick; }

  int wait_tick(std::int64_t* now_ns) noexcept {
    *now_ns = now_->now_ns;
    return 0;
  }
  RawSample read() noexcept { return now_->raw; }
  int write(const MotorCommand& /*command*/) noexcept { return 0; }
  int motors_off() noexcept { return 0; }

  const runtime::TickRecord& now() const noexcept { return *now_; }

 private:
  const runtime::TickRecord* now_ = nullptr;
};

/// What the runtime held against the motors, then.
template <class Io>
class LoggedSupervisor {
 public:
  explicit LoggedSupervisor(const Io& io) : io_(io) {}
  std::uint32_t begin(std::int64_t /*now_ns*/, const RawSample& /*raw*/) noexcept {
    return io_.now().inhibit;
  }
  void end(bool /*driven*/, int /*write_error*/) noexcept {}

 private:
  const Io& io_;
};

/// As the run judged it.
inline VerdictJudge::Tick judged(const runtime::TickRecord& r) noexcept {
  const double tilt_rad = r.has_truth ? std::hypot(r.truth.theta_rad[0], r.truth.theta_rad[1]) : std::nan("");
  const double simulated_s = 1e-9 * static_cast<double>(r.now_ns);
  return {r.has_truth ? simulated_s : static_cast<double>(r.tick) * kTickS, r.arm,
          r.arm_state == static_cast<std::int32_t>(ArmState::kArmed), r.reasons, tilt_rad};
}

/// What counts, as in sim: from the fifth second on; simulated clocks start at 0.
inline bool settled(const runtime::TickRecord& r) noexcept {
  return r.has_truth ? r.now_ns >= 5'000'000'000 : r.tick >= 1000;
}

/// `also(tick as logged)` after each tick.
template <class Pipeline, class Also>
Replay replay(RunLog& log, Pipeline& pipeline, std::optional<std::size_t> other, Also&& also) {
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
    also(tick);
    judge.observe(judged(tick));
    if (!tick.has_truth || !settled(tick)) return;
    out.logged.add(tick.estimate, tick.truth);
    if (other) out.other.add(record.others[*other], tick.truth);
  };
  out.ticks = runtime::run_loop(io, pipeline, commands, on_tick, never, supervisor).ticks;
  io.rethrow();
  out.verdict = log.end() ? Verdict::of(*log.end()) : judge.verdict(false, false);
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

template <class Firmware, class P>
typename P::Params params_of(const typename Firmware::Config& config, const std::string& controller) {
  std::optional<typename P::Params> params;
  Firmware::with_pipeline(config, controller, [&params](auto& pipeline) {
    if constexpr (std::is_same_v<std::decay_t<decltype(pipeline)>, P>) params = pipeline.params();
  });
  return params.value();
}

/// The run as recorded and, beside it, with the parameters `changed`.
template <class P>
Replay replay_retuned(RunLog& log, const typename P::Params& recorded, const typename P::Params& changed) {
  Tapped<P> leader(tapped<P>(recorded, true));
  Tapped<P> follower(tapped<P>(changed, false));
  GivenInputs<typename P::Input> inputs;
  leader.estimators().tap([&](auto* u, bool* held) { inputs.keep(*u, *held); });
  follower.estimators().tap([&](auto* u, bool* held) { inputs.hand_on(u, held); });
  Retuned retuned;
  runtime::TickRecord record{};
  HandedOverIo io;
  LoggedSupervisor supervisor(io);
  runtime::LoopEnd end;
  const auto commands = [&](std::int64_t, std::int64_t) {
    decltype(P::Result::x_hat) known;
    if (io.now().has_truth && recall(io.now().truth, &known)) follower.estimators().observe_truth(known);
    return command_of(io.now());
  };
  const auto on_tick = [&](std::int64_t, std::int64_t now_ns, const RawSample& raw, const Command& command,
                           const auto& result) {
    record_tick(io.now().tick, now_ns, raw, command, result, follower, &record);
  };
  const auto also = [&](const runtime::TickRecord& tick) {
    io.hand_over(tick);
    runtime::run_tick(io, follower, commands, on_tick, supervisor, &end);
    inputs.begin();
    if (settled(tick)) compare_tunings(tick, record, &retuned);
  };
  Replay out = replay(log, leader, std::nullopt, also);
  out.retuned = retuned;
  return out;
}

/// As replay_log(), of this robot's log.
template <class Firmware>
Replay replay_as(RunLog& log, const std::string& origin, const Beside& beside = {}) {
  const runtime::RunInfo& info = log.run();
  Choice choice{info.estimator, info.controller, info.fidelity, false, info.attitude, info.backend};
  complete<Firmware>(choice);
  Choice asked = choice;
  if (!beside.estimator.empty()) {
    asked.estimator = beside.estimator;
    complete<Firmware>(asked);
  }
  const std::string where = origin + " (its configuration)";
  const auto nothing = [](const runtime::TickRecord&) {};
  choice.compare = beside.set.empty() && !beside.estimator.empty();
  const auto config = Firmware::apply(Firmware::parse(info.config_toml, where).config, choice);
  const std::optional<std::size_t> index =
      choice.compare ? index_of<Firmware>(beside.estimator) : std::nullopt;
  Replay r = Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
    if (beside.set.empty()) return replay(log, pipeline, index, nothing);
    using P = std::decay_t<decltype(pipeline)>;
    const auto changed = Firmware::apply(Firmware::parse(info.config_toml, where, beside.set).config, asked);
    return replay_retuned<P>(log, pipeline.params(), params_of<Firmware, P>(changed, choice.controller));
  });
  if (r.ticks == 0) throw InputError(origin + ": holds no whole tick");
  return r;
}

}  // namespace equipoise::app
