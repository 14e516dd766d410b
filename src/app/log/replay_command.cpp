// `equipoise replay`.
#include <cstdio>
#include <filesystem>

#include "app/cli/commands.hpp"
#include "app/log/replay.hpp"
#include "app/log/shadow.hpp"
#include "app/text/errors.hpp"
#include "app/text/files.hpp"
#include "app/text/json.hpp"
#include "app/text/reasons.hpp"
#include "app/text/version.hpp"

namespace equipoise::app {
namespace {

struct ReplayArguments {
  std::string log;
  std::string json;
  Beside beside;
  bool shadow = false;
  std::string config;  // of the shadow
};

nlohmann::json to_json(const Beside& beside, const runtime::RunInfo& run, const Retuned& t) {
  const std::int64_t ticks = t.difference.ticks;
  return {{"set", beside.set},
          {"estimator", beside.estimator.empty() ? run.estimator : beside.estimator},
          {"recorded", t.recorded.json(ticks, run.rolling_radius_m)},
          {"changed", t.changed.json(ticks, run.rolling_radius_m)},
          {"difference", t.difference.json(run.rolling_radius_m)},
          {"not_armed_ticks", t.not_armed},
          {"reasons", reason_names(t.reasons)}};
}

nlohmann::json to_json(const ReplayArguments& a, const runtime::RunInfo& run, const Replay& r) {
  nlohmann::json difference = nullptr;
  if (r.difference.found) {
    difference = {{"tick", r.difference.tick},
                  {"field", r.difference.field},
                  {"logged", r.difference.logged},
                  {"replayed", r.difference.replayed}};
  }
  nlohmann::json errors = {{run.estimator, r.logged.json(run.rolling_radius_m)}};
  if (!r.retuned && !a.beside.estimator.empty())
    errors[a.beside.estimator] = r.other.json(run.rolling_radius_m);
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
  if (r.retuned) out["retuned"] = to_json(a.beside, run, *r.retuned);
  r.verdict.write(&out);
  return out;
}

void print(std::FILE* out, const runtime::RunInfo& run, const std::string& name, const ReplayErrors& e) {
  if (e.ticks == 0) return;
  const nlohmann::json j = e.json(run.rolling_radius_m);
  std::fprintf(out, "  %-18s attitude %.4f rad, rolling speed %.2f cm/s, position %.3f m (RMS)\n",
               name.c_str(), j["attitude_rmse_rad"].get<double>(),
               100.0 * j["rolling_speed_rmse_m_s"].get<double>(), j["position_rmse_m"].get<double>());
}

void print(std::FILE* out, const Beside& beside, const runtime::RunInfo& run, const Retuned& t) {
  const std::int64_t ticks = t.difference.ticks;
  if (ticks == 0) {
    std::fprintf(out, "  nothing to compare: the run was not armed after its first 5 s\n");
    return;
  }
  const auto figures = [&](const char* name, const Retuned::Figures& f) {
    const nlohmann::json j = f.json(ticks, run.rolling_radius_m);
    std::fprintf(out, "  %-18s duty %.4f (RMS), normalised innovation %.3f (mean), saturated %.2f %%\n", name,
                 j["duty_rms"].get<double>(), j["normalized_innovation_mean"].get<double>(),
                 100.0 * j["saturated_fraction"].get<double>());
    print(out, run, "", f.errors);
  };
  figures("recorded", t.recorded);
  figures(beside.estimator.empty() ? "changed" : beside.estimator.c_str(), t.changed);
  print(out, run, "between the two", t.difference);
  if (t.not_armed == 0) return;
  std::fprintf(out, "  changed, it would have taken the motors away in %lld of %lld ticks: %s\n",
               static_cast<long long>(t.not_armed), static_cast<long long>(ticks),
               reasons_text(t.reasons).c_str());
}

void print(std::FILE* out, const ReplayArguments& a, const runtime::RunInfo& run, const Replay& r) {
  std::fprintf(out, "%s: %s, %s, %s, %lld ticks\n", a.log.c_str(), run.robot.c_str(), run.estimator.c_str(),
               run.controller.c_str(), static_cast<long long>(r.ticks));
  if (r.missing > 0) {
    std::fprintf(out, "  %lld ticks are missing; what follows them cannot be the same\n",
                 static_cast<long long>(r.missing));
  }
  if (r.damaged_bytes > 0) std::fprintf(out, "  %zu bytes are damaged and skipped\n", r.damaged_bytes);
  if (r.difference.found) {
    std::fprintf(out, "  DIFFERS first at tick %lld: %s: logged %.17g, replayed %.17g\n",
                 static_cast<long long>(r.difference.tick), r.difference.field.c_str(), r.difference.logged,
                 r.difference.replayed);
  } else {
    std::fprintf(out, "  estimate, control and duty are the same, bit for bit\n");
  }
  std::fprintf(out, "  %s\n", r.verdict.sentence().c_str());
  print_reasons(out, r.verdict, r.safety);
  if (r.retuned) {
    print(out, a.beside, run, *r.retuned);
    return;
  }
  print(out, run, run.estimator, r.logged);
  if (!a.beside.estimator.empty()) print(out, run, a.beside.estimator, r.other);
}

/// No log but one of its own kind is replaced.
void check_log_output(const ReplayArguments& a) {
  const std::string& path = a.beside.log;
  if (path.empty() || !std::filesystem::exists(path)) return;
  check_log(path);
  if (RunLog(path).run().backend != kReplayBackend)
    throw InputError("--log " + path + ": exists and is the log of a run; choose another name");
}

int run_shadow(RunLog& log, const ReplayArguments& a) {
  const Shadow shadow = shadow_log(log, a.log, a.config, a.beside.set);
  std::FILE* out = a.json == "-" ? stderr : stdout;
  std::fprintf(out, "%s: %s, shadow of the %s filter\n", a.log.c_str(), log.run().robot.c_str(), "default");
  shadow.print(out);
  nlohmann::json json = shadow.json();
  json["log"] = a.log;
  json["robot"] = log.run().robot;
  json["config"] = a.config.empty() ? nlohmann::json(nullptr) : nlohmann::json(a.config);
  json["version"] = version();
  if (!a.json.empty()) write_json(json, a.json);
  return 0;
}

int run(const ReplayArguments& a) {
  RunLog log(a.log);
  log.show_progress("replay");
  if (a.shadow && !a.beside.log.empty()) throw InputError("--log: not with --shadow, which writes none");
  if (a.shadow) return run_shadow(log, a);
  if (log.run().backend == "import") {
    throw InputError(a.log +
                     ": another robot's, imported; nothing of it is ours to compare with. Use --shadow");
  }
  if (log.run().backend == kReplayBackend)
    throw InputError(a.log + ": what another tuning would have done (replay --log); replay the run itself");
  check_log_output(a);
  const Replay r = replay_log(log, a.log, a.beside);
  print(a.json == "-" ? stderr : stdout, a, log.run(), r);
  if (!a.json.empty()) write_json(to_json(a, log.run(), r), a.json);
  return r.identical() ? 0 : 1;
}

}  // namespace

void add_replay(Subcommand app) {
  const Subcommand command = app.subcommand("replay", "Re-runs the pipeline on a log's sensors, bit for bit")
                                 .example("equipoise replay logs/latest/run.lcm --estimator ekf13");
  auto a = std::make_shared<ReplayArguments>();
  command.option("log", a->log, "LCM event log of sim or run; its further parts are found").file().required();
  command.option("--estimator", a->beside.estimator,
                 "run this one beside it; errors against the log's truth");
  const Option set =
      command.option("--set", a->beside.set, "key=value: run this tuning beside it, e.g. noise or weights");
  command.option("--log", a->beside.log, "with --set: log of what this tuning would have done")
      .file()
      .needs(set);
  const Option shadow = command.flag(
      "--shadow", a->shadow, "beside a robot that other software drove: alarms, NIS, tilt, prediction");
  command.option("--config", a->config, "with --shadow: this robot, in place of the log's")
      .file()
      .needs(shadow);
  command.option("--json", a->json, "result as JSON, - for stdout").file();
  command.action([=] { return run(*a); });
}

}  // namespace equipoise::app
