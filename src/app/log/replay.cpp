#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <optional>

#include "app/cli/commands.hpp"
#include "app/log/run_log.hpp"
#include "app/run/firmware.hpp"
#include "equipoise/runtime/fields.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string log;
  std::string json;
  std::string estimator;
};

/// The first field and tick that differ.
struct Difference {
  bool found = false;
  std::int64_t tick = 0;
  std::string field;
  double logged = 0.0;
  double replayed = 0.0;
};

std::uint64_t bits(double value) {
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
void compare(const runtime::TickRecord& logged, const runtime::TickRecord& replayed, Difference* difference) {
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

/// Root mean square errors of an estimate against the log's truth, after the first five seconds as in sim.
struct Errors {
  double attitude = 0.0;
  double rate = 0.0;
  double position = 0.0;
  std::int64_t ticks = 0;

  void add(const runtime::StateRecord& x, const runtime::StateRecord& truth) {
    const auto square = [](double a) { return a * a; };
    for (std::size_t i = 0; i < 2; ++i) {
      attitude += square(x.theta_rad[i] - truth.theta_rad[i]) / 2.0;
      rate += square(x.phi_dot_rad_s[i] - truth.phi_dot_rad_s[i]) / 2.0;
      position += square(x.position_W_m[i] - truth.position_W_m[i]);
    }
    ++ticks;
  }
  nlohmann::json json(double radius_m) const {
    if (ticks == 0) return nullptr;
    const auto n = static_cast<double>(ticks);
    return {{"attitude_rmse_rad", std::sqrt(attitude / n)},
            {"rolling_rate_rmse_rad_s", std::sqrt(rate / n)},
            {"rolling_speed_rmse_m_s", radius_m * std::sqrt(rate / n)},
            {"position_rmse_m", std::sqrt(position / n)},
            {"ticks", ticks}};
  }
};

/// What the simulation knew, from what it logged; false for a robot whose log does not hold all of it.
template <class Estimate>
bool recall(const runtime::StateRecord&, Estimate*) noexcept {
  return false;
}
bool recall(const runtime::StateRecord& s, MbbrEstimate* truth) noexcept {
  truth->theta_xy = Vec2(s.theta_rad[0], s.theta_rad[1]);
  truth->theta_z = s.theta_rad[2];
  truth->omega_B = Vec3(s.omega_B_rad_s[0], s.omega_B_rad_s[1], s.omega_B_rad_s[2]);
  truth->theta_dot = euler_rates(truth->theta_xy, truth->omega_B);
  truth->phi_dot_star = Vec2(s.phi_dot_rad_s[0], s.phi_dot_rad_s[1]);
  truth->phi = Vec2(s.phi_rad[0], s.phi_rad[1]);
  return true;
}

struct Replay {
  std::int64_t ticks = 0;
  std::int64_t incomplete = 0;  // ticks of which the log lost a part
  std::size_t damaged_bytes = 0;
  std::int64_t missing = 0;  // ticks that the log lost
  Difference difference;
  Errors logged, other;

  bool identical() const { return ticks > 0 && missing == 0 && !difference.found; }
};

/// `other`: index of an estimator that runs beside the one that flew, on the same samples and inputs.
template <class Pipeline>
Replay replay(RunLog& log, Pipeline& pipeline, std::optional<std::size_t> other) {
  constexpr std::int64_t kSettled = 1000;  // ticks, 5 s
  Replay out;
  runtime::TickRecord record{};
  std::int64_t expected = 0;
  for (runtime::TickRecord tick; log.next(&tick);) {
    out.missing += tick.tick - expected;
    expected = tick.tick + 1;
    decltype(Pipeline::Result::x_hat) known;
    if (tick.has_truth && recall(tick.truth, &known)) pipeline.estimators().observe_truth(known);
    const Command command = command_of(tick);
    const auto result = pipeline.tick(tick.raw, command);
    record_tick(tick.tick, tick.now_ns, tick.raw, command, result, pipeline, &record);
    compare(tick, record, &out.difference);
    if (tick.has_truth && tick.tick >= kSettled) {
      out.logged.add(tick.estimate, tick.truth);
      if (other) out.other.add(record.others[*other], tick.truth);
    }
    ++out.ticks;
  }
  out.incomplete = log.incomplete_ticks();
  out.damaged_bytes = log.damaged_bytes();
  return out;
}

std::string shown(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

nlohmann::json to_json(const Arguments& a, const runtime::RunInfo& run, const Replay& r) {
  nlohmann::json difference = nullptr;
  if (r.difference.found) {
    difference = {{"tick", r.difference.tick},
                  {"field", r.difference.field},
                  {"logged", r.difference.logged},
                  {"replayed", r.difference.replayed}};
  }
  nlohmann::json errors = {{run.estimator, r.logged.json(run.rolling_radius_m)}};
  if (!a.estimator.empty()) errors[a.estimator] = r.other.json(run.rolling_radius_m);
  return {{"log", a.log},
          {"robot", run.robot},
          {"estimator", run.estimator},
          {"controller", run.controller},
          {"fidelity", run.fidelity},
          {"ticks", r.ticks},
          {"identical", r.identical()},
          {"first_difference", difference},
          {"missing_ticks", r.missing},
          {"incomplete_ticks", r.incomplete},
          {"damaged_bytes", r.damaged_bytes},
          {"errors", errors},
          {"log_version", run.version},
          {"version", version()}};
}

void print(std::FILE* out, const Arguments& a, const runtime::RunInfo& run, const Replay& r) {
  std::fprintf(out, "%s: %s, %s, %s, %lld ticks\n", a.log.c_str(), run.robot.c_str(), run.estimator.c_str(),
               run.controller.c_str(), static_cast<long long>(r.ticks));
  if (r.missing > 0) {
    std::fprintf(out, "  %lld ticks are missing; what follows them cannot be the same\n",
                 static_cast<long long>(r.missing));
  }
  if (r.damaged_bytes > 0) std::fprintf(out, "  %zu bytes are damaged and left out\n", r.damaged_bytes);
  if (r.difference.found) {
    std::fprintf(out, "  DIFFERS first at tick %lld: %s: logged %s, replayed %s\n",
                 static_cast<long long>(r.difference.tick), r.difference.field.c_str(),
                 shown(r.difference.logged).c_str(), shown(r.difference.replayed).c_str());
  } else {
    std::fprintf(out, "  estimate, control and duty are the same, bit for bit\n");
  }
  const auto errors = [&](const std::string& name, const Errors& e) {
    if (e.ticks == 0) return;
    const nlohmann::json j = e.json(run.rolling_radius_m);
    std::fprintf(out, "  %-18s attitude %.4f rad, rolling speed %.2f cm/s, position %.3f m (RMS)\n",
                 name.c_str(), j["attitude_rmse_rad"].get<double>(),
                 100.0 * j["rolling_speed_rmse_m_s"].get<double>(), j["position_rmse_m"].get<double>());
  };
  errors(run.estimator, r.logged);
  if (!a.estimator.empty()) errors(a.estimator, r.other);
}

template <class Firmware>
std::optional<std::size_t> index_of(const std::string& estimator) {
  const std::vector<std::string> names = Firmware::estimators();
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == estimator) return i;
  }
  return std::nullopt;
}

template <class Firmware>
int run(const Arguments& a, RunLog& log) {
  const runtime::RunInfo& info = log.run();
  Choice choice{info.estimator, info.controller, info.fidelity, false, info.attitude, info.backend};
  complete<Firmware>(choice);
  std::optional<std::size_t> other;
  if (!a.estimator.empty()) {
    Choice asked{a.estimator, info.controller, "", false, ""};
    complete<Firmware>(asked);
    other = index_of<Firmware>(a.estimator);
    choice.compare = true;
  }
  const auto loaded = Firmware::parse(info.config_toml, a.log + " (its configuration)");
  const auto config = Firmware::apply(loaded.config, choice);
  const Replay r = Firmware::with_pipeline(config, choice.controller,
                                           [&](auto& pipeline) { return replay(log, pipeline, other); });
  if (r.ticks == 0) throw InputError(a.log + ": holds no whole tick");
  print(a.json == "-" ? stderr : stdout, a, info, r);
  if (!a.json.empty()) write_json(to_json(a, info, r), a.json);
  return r.identical() ? 0 : 1;
}

}  // namespace

void add_replay(Subcommand app) {
  const Subcommand command = app.subcommand("replay", "Re-runs the pipeline on a log's sensors, bit for bit");
  auto a = std::make_shared<Arguments>();
  command.option("log", a->log, "LCM event log of sim or run; its further parts are found").required();
  command.option("--estimator", a->estimator, "run this one beside it; errors against the log's truth");
  command.option("--json", a->json, "result as JSON, - for stdout");
  command.action([=] {
    RunLog log(a->log);
    return with_robot(log.run().robot, a->log,
                      [&](auto firmware) { return run<decltype(firmware)>(*a, log); });
  });
}

}  // namespace equipoise::app
