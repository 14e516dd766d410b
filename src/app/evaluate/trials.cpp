// `equipoise trials`: many simulated runs without logs in one process, for campaigns over a population.
#include <algorithm>
#include <memory>

#include "app/cli/commands.hpp"
#include "app/evaluate/parallel.hpp"
#include "app/sim/sim_job.hpp"
#include "app/text/json.hpp"
#include "app/text/version.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string config;
  std::string in;
  std::string json = "-";
  std::vector<std::string> set;
  int jobs = 0;
  bool twins = false;
};

/// A row of the input: its own keys, and the world of robots as built where it names none.
SimRequest request_of(const Arguments& a, const nlohmann::json& row) {
  static const std::vector<std::string> kKeys{"robot",      "seed",     "yaw_hz",    "drive_mps",
                                              "duration_s", "fidelity", "estimator", "controller"};
  for (const auto& [key, value] : row.items()) {
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
      throw InputError("trials: \"" + key + "\" is not a key of a trial");
  }
  if (row.contains("seed") && !row["seed"].is_number_unsigned())
    throw InputError("trials: seed: expected a whole number of 0 or more");
  SimRequest r;
  r.config = a.config;
  r.set = a.set;
  r.robot = row.value("robot", r.robot);
  r.seed = row.value("seed", r.seed);
  r.yaw_rate_rad_s = 2.0 * kPi * row.value("yaw_hz", 0.0);
  r.drive_mps = row.value("drive_mps", r.drive_mps);
  r.duration_s = row.value("duration_s", r.duration_s);
  r.choice.fidelity = row.value("fidelity", "full");
  r.choice.estimator = row.value("estimator", "");
  r.choice.controller = row.value("controller", "");
  check(r);
  return r;
}

SimSummary summary_of(SimRequest* r, std::vector<config::Drawn>* drawn = nullptr) {
  const auto robot = load_for(r, drawn);
  const std::atomic<bool> stop{false};
  return simulate(*robot, r->choice, options_for(*r, *robot), {}, stop);
}

/// What its fault detection did to a robot without a fault; null where no twin without it has run.
nlohmann::json judged(const SimSummary& run, SimRequest r, bool twins) {
  nlohmann::json out{{"excluded_healthy", (run.degraded & kSensorsJudged) != 0},
                     {"off_though_it_stands", nullptr},
                     {"saved_by_detector", nullptr}};
  if (!twins) return out;
  r.set.emplace_back("safety.detection=false");
  const bool twin_stands = !summary_of(&r).verdict.fell();
  out["off_though_it_stands"] = run.verdict.ended == Ended::kDisarmed && twin_stands;
  out["saved_by_detector"] = !run.verdict.fell() && !twin_stands;
  return out;
}

nlohmann::json run(const RobotType& type, SimRequest r, bool twins) {
  std::vector<config::Drawn> drawn;
  const SimSummary summary = summary_of(&r, &drawn);
  nlohmann::json row = figures(type, summary);
  row.update(judged(summary, r, twins));
  row.update({{"robot", r.robot},
              {"seed", r.seed},
              {"yaw_hz", r.yaw_rate_rad_s / (2.0 * kPi)},
              {"drive_mps", r.drive_mps},
              {"duration_s", r.duration_s},
              {"fidelity", r.choice.fidelity},
              {"drawn", by_name(drawn)}});
  return row;
}

int run_all(const Arguments& a) {
  const RobotType& type = robot_type_of(robot_type(a.config), a.config);
  const nlohmann::json in = read_json(a.in);
  std::vector<SimRequest> trials;
  try {
    for (const nlohmann::json& row : in.at("trials")) trials.push_back(request_of(a, row));
  } catch (const nlohmann::json::exception& error) {
    throw InputError(a.in + ": " + error.what());
  }
  std::vector<nlohmann::json> rows(trials.size());
  in_parallel("trials", trials.size(), threads_for(a.jobs),
              [&](std::size_t i) { rows[i] = run(type, trials[i], a.twins); });
  write_json({{"robot", type.name}, {"version", version()}, {"trials", rows}}, a.json);
  return 0;
}

}  // namespace

void add_trials(Subcommand app) {
  const Subcommand command =
      app.subcommand("trials", "Simulates many runs of drawn robots, without logs, on all cores")
          .example("equipoise trials --config config/mbbr.toml --in trials.json --json results.json");
  auto a = std::make_shared<Arguments>();
  command.option("--config", a->config, "robot configuration, TOML").file().required();
  command
      .option("--in", a->in,
              "JSON: {\"trials\": [{robot, seed, yaw_hz, drive_mps, duration_s, fidelity, estimator, "
              "controller}, "
              "...]}, each key optional")
      .required();
  command.option("--json", a->json, "results in the same order, - for stdout").file().show_default();
  command.option("--set", a->set, "override a configuration key in every trial");
  command.flag("--twins", a->twins,
               "run each again with safety.detection = false: was a robot off that stands, or saved?");
  command.option("--jobs", a->jobs, "threads; 0: one per core. The results do not depend on it")
      .show_default()
      .range(0, 1024);
  command.action([=] { return run_all(*a); });
}

}  // namespace equipoise::app
