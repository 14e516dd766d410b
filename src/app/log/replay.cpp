#include "app/log/replay.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "app/text/errors.hpp"
#include "equipoise/runtime/fields.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {
namespace {

std::uint64_t bits(double value) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

/// A number that the tick computed; the rest went into it, or is about the loop.
struct Computed {
  const char* channel;
  const char* field;
  int index;  // -1: it has none
  double value;
};

/// In the order of the tick. `faults`: an older log has none.
std::vector<Computed> computed(const runtime::TickRecord& r, bool faults) {
  namespace fields = runtime::fields;
  std::vector<Computed> out;
  const auto add = [&](auto message, const char* channel, const auto& record) {
    using Message = decltype(message);
    if constexpr (std::is_same_v<Message, fields::State> || std::is_same_v<Message, fields::Motors> ||
                  std::is_same_v<Message, fields::Health> || std::is_same_v<Message, fields::Faults>) {
      Message::visit(record, [&](const char* field, const auto& value) {
        if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) {
          out.push_back({channel, field, -1, static_cast<double>(value)});
        } else {
          int i = 0;
          for (const double element : value) out.push_back({channel, field, i++, element});
        }
      });
    }
  };
  fields::each_message(r, add);
  if (faults) add(fields::Faults{}, fields::kFaultsChannel, r.faults);
  return out;
}

/// What another tuning would have done, as a log: `replay` is its backend, for it was no run.
class ChangedLog {
 public:
  ChangedLog(const std::string& path, runtime::RunInfo run) : telemetry_(options(path, std::move(run))) {}

  void add(const runtime::TickRecord& recorded, runtime::TickRecord changed) {
    changed.tick = recorded.tick;
    changed.has_truth = recorded.has_truth;
    changed.truth = recorded.truth;
    telemetry_.hand_over(changed);
    judge_.observe(judged(changed));
  }
  void finish() {
    const auto report = telemetry_.finish(judge_.verdict(false, false).record());
    if (!report.log_error.empty()) throw InputError(report.log_error);
  }

 private:
  static runtime::TelemetryOptions options(const std::string& path, runtime::RunInfo run) {
    runtime::TelemetryOptions out;
    out.log_path = path;
    out.wait_when_full = true;
    out.run = std::move(run);
    out.run.backend = kReplayBackend;
    return out;
  }

  runtime::Telemetry telemetry_;
  VerdictJudge judge_;
};

/// The logged tick once more.
runtime::TickRecord again(const runtime::TickRecord& tick, Firmware& firmware) {
  if (tick.has_truth) firmware.observe_truth(tick.truth);
  const LoggedTick logged{tick.now_ns, tick.raw, tick.inhibit};
  const auto command = [&](std::int64_t, std::int64_t) { return command_of(tick); };
  runtime::TickRecord record;
  const auto keep = [&record](const auto&, const auto&, const auto&, const auto&, const auto& r) {
    record = r;
  };
  runtime::LoopEnd end;
  runtime::run_tick(logged, firmware, command, keep, logged, &end);
  return record;
}

/// One tick of both into the comparison.
void compare_tunings(const runtime::TickRecord& recorded, const runtime::TickRecord& retuned, Retuned* out) {
  constexpr auto armed = static_cast<std::int32_t>(ArmState::kArmed);
  if (recorded.arm_state != armed) return;
  out->difference.add(retuned.estimate, recorded.estimate);
  const auto mean_square = [](const runtime::TickRecord& r) {
    double sum = 0.0;
    for (int i = 0; i < r.motor_count; ++i) sum += std::pow(r.motors.duty[i], 2) / r.motor_count;
    return sum;
  };
  const auto add = [&](const runtime::TickRecord& r, Retuned::Figures* figures) {
    if (recorded.has_truth) figures->errors.add(r.estimate, recorded.truth);
    figures->duty_squared += mean_square(r);
    figures->innovation += r.estimate.normalized_innovation;
    if (r.saturated) ++figures->saturated;
  };
  add(recorded, &out->recorded);
  add(retuned, &out->changed);
  if (retuned.arm_state == armed) return;
  ++out->not_armed;
  out->reasons |= retuned.reasons;
}

/// `follower`, where there is one: its record of the same tick into `retuned`, and into `changed`.
Replay replay(RunLog& log, Firmware& firmware, std::optional<std::size_t> other, Firmware* follower,
              ChangedLog* changed) {
  Replay out;
  Retuned retuned;
  std::int64_t expected = 0;
  VerdictJudge judge;
  for (runtime::TickRecord tick; log.next(&tick); ++out.ticks) {
    const runtime::TickRecord record = again(tick, firmware);
    out.missing += tick.tick - expected;
    expected = tick.tick + 1;
    compare(tick, record, &out.difference);
    if (follower != nullptr) {
      const runtime::TickRecord followed = again(tick, *follower);
      if (settled(tick)) compare_tunings(tick, followed, &retuned);
      if (changed != nullptr) changed->add(tick, followed);
    }
    judge.observe(judged(tick));
    if (!tick.has_truth || !settled(tick)) continue;
    out.logged.add(tick.estimate, tick.truth);
    if (other) out.other.add(record.others[*other], tick.truth);
  }
  const Verdict by_its_ticks = judge.verdict(false, false);
  out.verdict = log.end() ? Verdict::of(*log.end()) : by_its_ticks;
  out.verdict.numbers = by_its_ticks.numbers;
  out.verdict.faults = by_its_ticks.faults;
  out.incomplete = log.incomplete_ticks();
  out.damaged_bytes = log.damaged_bytes();
  if (follower != nullptr) out.retuned = retuned;
  return out;
}

std::optional<std::size_t> index_of(const RobotType& robot, const std::string& estimator) {
  const auto& names = robot.estimators;
  const auto at = std::find(names.begin(), names.end(), estimator);
  if (at == names.end()) return std::nullopt;
  return static_cast<std::size_t>(at - names.begin());
}

}  // namespace

void ReplayErrors::add(const runtime::StateRecord& x, const runtime::StateRecord& truth) {
  const auto square = [](double a) { return a * a; };
  for (std::size_t i = 0; i < 2; ++i) {
    attitude += square(x.theta_rad[i] - truth.theta_rad[i]) / 2.0;
    rate += square(x.phi_dot_rad_s[i] - truth.phi_dot_rad_s[i]) / 2.0;
    position += square(x.position_W_m[i] - truth.position_W_m[i]);
  }
  ++ticks;
}

nlohmann::json ReplayErrors::json(double radius_m) const {
  if (ticks == 0) return nullptr;
  const auto n = static_cast<double>(ticks);
  return {{"attitude_rmse_rad", std::sqrt(attitude / n)},
          {"rolling_rate_rmse_rad_s", std::sqrt(rate / n)},
          {"rolling_speed_rmse_m_s", radius_m * std::sqrt(rate / n)},
          {"position_rmse_m", std::sqrt(position / n)},
          {"ticks", ticks}};
}

nlohmann::json Retuned::Figures::json(std::int64_t ticks, double radius_m) const {
  if (ticks == 0) return nullptr;
  const auto n = static_cast<double>(ticks);
  return {{"errors", errors.json(radius_m)},
          {"duty_rms", std::sqrt(duty_squared / n)},
          {"normalized_innovation_mean", innovation / n},
          {"saturated_fraction", static_cast<double>(saturated) / n}};
}

void compare(const runtime::TickRecord& logged, const runtime::TickRecord& replayed, Difference* difference) {
  if (difference->found) return;
  const bool faults = logged.faults.bound > 0.0;
  const std::vector<Computed> was = computed(logged, faults);
  const std::vector<Computed> is = computed(replayed, faults);
  for (std::size_t k = 0; k < is.size(); ++k) {
    const Computed& c = is[k];
    if (bits(was[k].value) == bits(c.value) || (std::isnan(was[k].value) && std::isnan(c.value))) continue;
    const std::string index = c.index < 0 ? "" : "[" + std::to_string(c.index) + "]";
    *difference = {true, logged.tick, std::string(c.channel) + "." + c.field + index, was[k].value, c.value};
    return;
  }
}

VerdictJudge::Tick judged(const runtime::TickRecord& r) noexcept {
  const double tilt_rad = r.has_truth ? std::hypot(r.truth.theta_rad[0], r.truth.theta_rad[1]) : std::nan("");
  const double simulated_s = 1e-9 * static_cast<double>(r.now_ns);
  return {r.has_truth ? simulated_s : static_cast<double>(r.tick) * kTickS,
          r.arm,
          r.arm_state == static_cast<std::int32_t>(ArmState::kArmed),
          r.reasons,
          tilt_rad,
          reason_numbers(r),
          r.faults};
}

bool settled(const runtime::TickRecord& r) noexcept {
  return r.has_truth ? r.now_ns >= 5'000'000'000 : r.tick >= 1000;
}

Replay replay_as(const RobotType& robot, RunLog& log, const std::string& origin, const Beside& beside) {
  const runtime::RunInfo& info = log.run();
  Choice choice{info.estimator, info.controller, info.fidelity, false, info.attitude, info.backend};
  complete(robot, &choice);
  Choice asked = choice;
  if (!beside.estimator.empty()) {
    asked.estimator = beside.estimator;
    complete(robot, &asked);
  }
  const std::string where = origin + " (its configuration)";
  const auto recorded = robot.parse(info.config_toml, where, {});
  Replay r;
  if (beside.set.empty()) {
    choice.compare = !beside.estimator.empty();
    r = replay(log, *recorded->firmware(choice),
               choice.compare ? index_of(robot, beside.estimator) : std::nullopt, nullptr, nullptr);
  } else {
    const auto changed = robot.parse(info.config_toml, where, beside.set);
    const Retuning both = recorded->retuning(choice, *changed, asked);
    std::optional<ChangedLog> ticks;
    if (!beside.log.empty()) ticks.emplace(beside.log, run_info(*changed, asked, info.seed));
    r = replay(log, *both.recorded, std::nullopt, both.changed.get(), ticks ? &*ticks : nullptr);
    if (ticks) ticks->finish();
  }
  r.safety = recorded->safety;
  if (r.ticks == 0) throw InputError(origin + ": holds no whole tick");
  return r;
}

Replay replay_log(RunLog& log, const std::string& origin, const Beside& beside) {
  return replay_as(robot_type_of(log.run().robot, origin), log, origin, beside);
}

}  // namespace equipoise::app
