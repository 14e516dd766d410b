#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <optional>

#include "app/cli/commands.hpp"
#include "app/log/flight_log.hpp"
#include "app/run/firmware.hpp"

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

/// Compares bit for bit, but takes any NaN for any other.
class Comparison {
 public:
  explicit Comparison(std::int64_t tick, Difference* difference) : tick_(tick), difference_(difference) {}

  void value(const std::string& field, double logged, double replayed) {
    if (difference_->found || bits(logged) == bits(replayed)) return;
    if (std::isnan(logged) && std::isnan(replayed)) return;
    *difference_ = {true, tick_, field, logged, replayed};
  }
  template <std::size_t N, class Replayed>
  void values(const std::string& field, const double (&logged)[N], const Replayed& replayed) {
    for (std::size_t i = 0; i < N && !difference_->found; ++i)
      value(field + "[" + std::to_string(i) + "]", logged[i], replayed[i]);
  }
  void state(const std::string& channel, const state_t& logged, const runtime::StateRecord& replayed) {
    values(channel + ".theta_rad", logged.theta_rad, replayed.theta_rad);
    values(channel + ".omega_B_rad_s", logged.omega_B_rad_s, replayed.omega_B_rad_s);
    values(channel + ".phi_rad", logged.phi_rad, replayed.phi_rad);
    values(channel + ".phi_dot_rad_s", logged.phi_dot_rad_s, replayed.phi_dot_rad_s);
    values(channel + ".position_W_m", logged.position_W_m, replayed.position_W_m);
    value(channel + ".normalized_innovation", logged.normalized_innovation, replayed.normalized_innovation);
  }

 private:
  std::int64_t tick_;
  Difference* difference_;
};

/// In the order of the tick, so that the first difference is nearest to its cause.
void compare(const LoggedTick& logged, const runtime::TickRecord& r, Difference* difference) {
  Comparison c(logged.sensors.tick, difference);
  c.state("EQUIPOISE_STATE", logged.estimate, r.estimate);
  c.state("EQUIPOISE_REFERENCE", logged.reference, r.reference);
  c.values("EQUIPOISE_MOTORS.u_lin", logged.motors.u_lin, r.u_lin);
  c.values("EQUIPOISE_MOTORS.u_friction", logged.motors.u_friction, r.u_friction);
  c.value("EQUIPOISE_MOTORS.saturated", logged.motors.saturated, r.saturated ? 1 : 0);
  c.value("EQUIPOISE_HEALTH.battery_V", logged.health.battery_V, r.battery_V);
  c.value("EQUIPOISE_HEALTH.reasons", static_cast<std::uint32_t>(logged.health.reasons), r.reasons);
  c.value("EQUIPOISE_HEALTH.arm_state", logged.health.arm_state, r.arm_state);
  c.values("EQUIPOISE_MOTORS.duty", logged.motors.duty, r.duty);
  c.value("EQUIPOISE_MOTORS.enable", logged.motors.enable, r.enable ? 1 : 0);
}

/// Root mean square errors of an estimate against the log's truth, after the first five seconds as in sim.
struct Errors {
  double attitude = 0.0;
  double rate = 0.0;
  double position = 0.0;
  std::int64_t ticks = 0;

  void add(const runtime::StateRecord& x, const state_t& truth) {
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
  std::int64_t missing = 0;  // ticks that the log lost
  Difference difference;
  Errors logged, other;

  bool identical() const { return ticks > 0 && missing == 0 && !difference.found; }
};

/// `other`: index of an estimator that runs beside the one that flew, on the same samples and inputs.
template <class Pipeline>
Replay replay(const FlightLog& log, Pipeline& pipeline, std::optional<std::size_t> other) {
  constexpr std::int64_t kSettled = 1000;  // ticks, 5 s
  Replay out;
  runtime::TickRecord record{};
  std::int64_t expected = 0;
  for (const LoggedTick& tick : log.ticks) {
    out.missing += tick.sensors.tick - expected;
    expected = tick.sensors.tick + 1;
    decltype(Pipeline::Result::x_hat) known;
    if (tick.has_truth && recall(state_of(tick.truth), &known)) pipeline.estimators().observe_truth(known);
    const RawSample raw = raw_of(tick.sensors);
    const Command command = command_of(tick.command);
    const auto result = pipeline.tick(raw, command);
    record_tick(tick.sensors.tick, tick.sensors.utime * 1000, raw, command, result, pipeline, &record);
    compare(tick, record, &out.difference);
    if (tick.has_truth && tick.sensors.tick >= kSettled) {
      out.logged.add(state_of(tick.estimate), tick.truth);
      if (other) out.other.add(record.others[*other], tick.truth);
    }
    ++out.ticks;
  }
  return out;
}

std::string shown(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

nlohmann::json to_json(const Arguments& a, const FlightLog& log, const Replay& r) {
  nlohmann::json difference = nullptr;
  if (r.difference.found) {
    difference = {{"tick", r.difference.tick},
                  {"field", r.difference.field},
                  {"logged", r.difference.logged},
                  {"replayed", r.difference.replayed}};
  }
  nlohmann::json errors = {{log.run.estimator, r.logged.json(log.run.rolling_radius_m)}};
  if (!a.estimator.empty()) errors[a.estimator] = r.other.json(log.run.rolling_radius_m);
  return {{"log", a.log},
          {"robot", log.run.robot},
          {"estimator", log.run.estimator},
          {"controller", log.run.controller},
          {"fidelity", log.run.fidelity},
          {"ticks", r.ticks},
          {"identical", r.identical()},
          {"first_difference", difference},
          {"missing_ticks", r.missing},
          {"incomplete_ticks", log.incomplete_ticks},
          {"damaged_bytes", log.damaged_bytes},
          {"errors", errors},
          {"log_version", log.run.version},
          {"version", version()}};
}

void print(std::FILE* out, const Arguments& a, const FlightLog& log, const Replay& r) {
  std::fprintf(out, "%s: %s, %s, %s, %lld ticks\n", a.log.c_str(), log.run.robot.c_str(),
               log.run.estimator.c_str(), log.run.controller.c_str(), static_cast<long long>(r.ticks));
  if (r.missing > 0) {
    std::fprintf(out, "  %lld ticks are missing; what follows them cannot be the same\n",
                 static_cast<long long>(r.missing));
  }
  if (log.damaged_bytes > 0) std::fprintf(out, "  %zu bytes are damaged and left out\n", log.damaged_bytes);
  if (r.difference.found) {
    std::fprintf(out, "  DIFFERS first at tick %lld: %s: logged %s, replayed %s\n",
                 static_cast<long long>(r.difference.tick), r.difference.field.c_str(),
                 shown(r.difference.logged).c_str(), shown(r.difference.replayed).c_str());
  } else {
    std::fprintf(out, "  estimate, control and duty are the same, bit for bit\n");
  }
  const auto errors = [&](const std::string& name, const Errors& e) {
    if (e.ticks == 0) return;
    const nlohmann::json j = e.json(log.run.rolling_radius_m);
    std::fprintf(out, "  %-18s attitude %.4f rad, rolling speed %.2f cm/s, position %.3f m (RMS)\n",
                 name.c_str(), j["attitude_rmse_rad"].get<double>(),
                 100.0 * j["rolling_speed_rmse_m_s"].get<double>(), j["position_rmse_m"].get<double>());
  };
  errors(log.run.estimator, r.logged);
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
int run(const Arguments& a, const FlightLog& log) {
  Choice choice{log.run.estimator, log.run.controller, log.run.fidelity, false,
                log.run.attitude,  log.run.backend};
  complete<Firmware>(choice);
  std::optional<std::size_t> other;
  if (!a.estimator.empty()) {
    Choice asked{a.estimator, log.run.controller, "", false, ""};
    complete<Firmware>(asked);
    other = index_of<Firmware>(a.estimator);
    choice.compare = true;
  }
  const auto loaded = Firmware::parse(log.run.config_toml, a.log + " (its configuration)");
  const auto config = Firmware::apply(loaded.config, choice);
  const Replay r = Firmware::with_pipeline(config, choice.controller,
                                           [&](auto& pipeline) { return replay(log, pipeline, other); });
  if (r.ticks == 0) throw InputError(a.log + ": holds no whole tick");
  print(a.json == "-" ? stderr : stdout, a, log, r);
  if (!a.json.empty()) write_json(to_json(a, log, r), a.json);
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
    const FlightLog log = read_flight_log(a->log);
    return with_robot(log.run.robot, a->log, [&](auto firmware) { return run<decltype(firmware)>(*a, log); });
  });
}

}  // namespace equipoise::app
