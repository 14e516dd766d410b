// `equipoise replay`.
#include <cstdio>

#include "app/cli/commands.hpp"
#include "app/log/replay.hpp"
#include "app/run/firmware.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string log;
  std::string json;
  std::string estimator;
};

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
  nlohmann::json out{{"log", a.log},
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
  r.verdict.write(&out);
  return out;
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
  std::fprintf(out, "  %s\n", r.verdict.sentence().c_str());
  const auto errors = [&](const std::string& name, const ReplayErrors& e) {
    if (e.ticks == 0) return;
    const nlohmann::json j = e.json(run.rolling_radius_m);
    std::fprintf(out, "  %-18s attitude %.4f rad, rolling speed %.2f cm/s, position %.3f m (RMS)\n",
                 name.c_str(), j["attitude_rmse_rad"].get<double>(),
                 100.0 * j["rolling_speed_rmse_m_s"].get<double>(), j["position_rmse_m"].get<double>());
  };
  errors(run.estimator, r.logged);
  if (!a.estimator.empty()) errors(a.estimator, r.other);
}

int run(const Arguments& a) {
  RunLog log(a.log);
  const Replay r = replay_log(log, a.log, a.estimator);
  print(a.json == "-" ? stderr : stdout, a, log.run(), r);
  if (!a.json.empty()) write_json(to_json(a, log.run(), r), a.json);
  return r.identical() ? 0 : 1;
}

}  // namespace

void add_replay(Subcommand app) {
  const Subcommand command = app.subcommand("replay", "Re-runs the pipeline on a log's sensors, bit for bit");
  auto a = std::make_shared<Arguments>();
  command.option("log", a->log, "LCM event log of sim or run; its further parts are found").required();
  command.option("--estimator", a->estimator, "run this one beside it; errors against the log's truth");
  command.option("--json", a->json, "result as JSON, - for stdout");
  command.action([=] { return run(*a); });
}

}  // namespace equipoise::app
