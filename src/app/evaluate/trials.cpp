// `equipoise trials`: many simulated runs without logs in one process, for campaigns over a population.
#include <algorithm>
#include <memory>

#include "app/cli/commands.hpp"
#include "app/evaluate/parallel.hpp"
#include "app/sim/simulate.hpp"
#include "config/population.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string config;
  std::string in;
  std::string json = "-";
  std::vector<std::string> set;
  int jobs = 0;
};

struct Trial {
  std::int64_t robot = 0;
  SimOptions options;
  Choice choice{"", "", "full", false, "dmp", ""};
  double yaw_hz = 0.0;
};

template <class Value>
void take(const nlohmann::json& row, const char* key, Value* value) {
  if (row.contains(key)) row.at(key).get_to(*value);
}

Trial trial_of(const nlohmann::json& row) {
  static const std::vector<std::string> kKeys{"robot",      "seed",     "yaw_hz",    "drive_mps",
                                              "duration_s", "fidelity", "estimator", "controller"};
  for (const auto& [key, value] : row.items()) {
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
      throw InputError("trials: \"" + key + "\" is not a key of a trial");
  }
  Trial t;
  take(row, "robot", &t.robot);
  take(row, "seed", &t.options.seed);
  take(row, "yaw_hz", &t.yaw_hz);
  take(row, "drive_mps", &t.options.drive_mps);
  take(row, "duration_s", &t.options.duration_s);
  take(row, "fidelity", &t.choice.fidelity);
  take(row, "estimator", &t.choice.estimator);
  take(row, "controller", &t.choice.controller);
  if (t.robot < 0) throw InputError("trials: robot must not be negative");
  if (!(t.options.duration_s > 0.0 && t.options.duration_s <= 360000.0) || !(std::abs(t.yaw_hz) <= 5.0) ||
      !(std::abs(t.options.drive_mps) <= 2.0))
    throw InputError("trials: duration_s, yaw_hz or drive_mps is out of range");
  t.options.yaw_rate_rad_s = 2.0 * kPi * t.yaw_hz;
  return t;
}

template <class Firmware>
nlohmann::json run(const Arguments& a, Trial t) {
  complete<Firmware>(t.choice);
  const auto drawn = config::draw_robot(a.config, a.set, t.choice.fidelity, t.robot);
  const auto loaded = Firmware::load(a.config, config::with_robot_drawn(drawn, t.choice.fidelity, a.set));
  const std::atomic<bool> stop{false};
  const SimSummary s = simulate<Firmware>(loaded.config, t.choice, t.options, {}, stop);
  nlohmann::json imperfections = nlohmann::json::object();
  for (const config::Drawn& d : drawn) {
    for (std::size_t i = 0; i < d.values.size(); ++i)
      imperfections[d.values.size() == 1 ? d.key : d.key + "[" + std::to_string(i) + "]"] = d.values[i];
  }
  nlohmann::json row{{"robot", t.robot},
                     {"seed", t.options.seed},
                     {"yaw_hz", t.yaw_hz},
                     {"drive_mps", t.options.drive_mps},
                     {"duration_s", t.options.duration_s},
                     {"fidelity", t.choice.fidelity},
                     {"attitude_rmse_rad", s.controlling.attitude_rmse_rad},
                     {Firmware::kSpeedRmseKey, s.controlling.speed_rmse},
                     {"yaw_frame_speed_rmse_m_s", s.yaw_frame_speed_rmse_m_s},
                     {"heading_error_rad", s.heading_error_rad},
                     {"position_rmse_m", s.position_rmse_m},
                     {"yaw_rate_mean_hz", s.yaw_rate_mean_hz},
                     {"duty_max", s.duty_max},
                     {"saturated_fraction", s.saturated_fraction},
                     {"drawn", imperfections}};
  s.verdict.write(&row);
  return row;
}

template <class Firmware>
int run_all(const Arguments& a) {
  const nlohmann::json in = read_json(a.in);
  std::vector<Trial> trials;
  try {
    for (const nlohmann::json& row : in.at("trials")) trials.push_back(trial_of(row));
  } catch (const nlohmann::json::exception& error) {
    throw InputError(a.in + ": " + error.what());
  }
  const auto rows = in_parallel<nlohmann::json>(trials.size(), threads_for(a.jobs),
                                                [&](std::size_t i) { return run<Firmware>(a, trials[i]); });
  write_json({{"robot", Firmware::kName}, {"version", version()}, {"trials", rows}}, a.json);
  return 0;
}

}  // namespace

void add_trials(Subcommand app) {
  const Subcommand command =
      app.subcommand("trials", "simulate many runs of drawn robots, without logs, on all cores");
  auto a = std::make_shared<Arguments>();
  command.option("--config", a->config, "robot configuration, TOML").required();
  command
      .option("--in", a->in,
              "JSON: {\"trials\": [{robot, seed, yaw_hz, drive_mps, duration_s, fidelity, estimator, "
              "controller}, "
              "...]}, each key optional")
      .required();
  command.option("--json", a->json, "results in the same order, - for stdout").show_default();
  command.option("--set", a->set, "override a configuration key in every trial");
  command.option("--jobs", a->jobs, "threads; 0: one per core. The results do not depend on it")
      .show_default()
      .range(0, 1024);
  command.action([=] {
    return with_robot(robot_type(a->config), a->config,
                      [&](auto firmware) { return run_all<decltype(firmware)>(*a); });
  });
}

}  // namespace equipoise::app
