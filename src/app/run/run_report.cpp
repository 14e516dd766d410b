#include <cstdio>
#include <limits>

#include "app/run/run_arguments.hpp"
#include "app/text/format.hpp"
#include "app/text/reasons.hpp"
#include "app/text/version.hpp"

namespace equipoise::app {
namespace {

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();  // null in JSON

nlohmann::json to_json(const RunArguments& a, const ConfiguredRobot& robot, const Outcome& o, int trials,
                       const nlohmann::json& session) {
  const Trial& t = o.trial;
  nlohmann::json out{
      {"robot", robot.type->name},
      {"backend", a.backend},
      {"estimator", a.choice.estimator},
      {"controller", a.choice.controller},
      {"duration_s", t.duration_s()},
      {"ticks", t.ticks},
      {"armed", t.armed},
      {"duty_max", t.driven > 0 ? t.duty_max : kNotMeasured},
      {"saturated_fraction",
       t.driven > 0 ? static_cast<double>(t.saturated) / static_cast<double>(t.driven) : kNotMeasured},
      {"trials", trials},
      {"flights", trials},  // the earlier word
      {"end", o.end},
      {"error", o.error.empty() ? nlohmann::json(nullptr) : nlohmann::json(o.error)},
      {"log", o.log},
      {"config_sha256", robot.sha256},
      {"version", version()}};
  t.verdict.write(&out);
  if (!session.is_null()) out.update(session);
  return out;
}

}  // namespace

int report(const RunArguments& a, const ConfiguredRobot& robot, Outcome o, int trials,
           const nlohmann::json& session) {
  const Trial& t = o.trial;
  if (o.error.empty() && t.verdict.fell() && t.armed)
    o.error =
        format("the motors went off at %.2f s: ", t.verdict.fell_at_s) + reasons_text(t.verdict.reasons);
  if (o.error.empty() && a.arm && a.command_key.empty() && !t.armed && t.duration_s() > 0.6)
    o.error = "the robot never armed: " + reasons_text(t.verdict.reasons);
  std::FILE* const out = a.json == "-" ? stderr : stdout;
  std::fprintf(out, "%s  (%s, %s, %s)\n", t.verdict.sentence().c_str(), a.backend.c_str(),
               a.choice.estimator.c_str(), a.choice.controller.c_str());
  print_reasons(out, t.verdict, robot.safety);
  std::fprintf(out, "  duty max        %8.3f\n  log             %s\n", t.duty_max, o.log.c_str());
  if (!a.json.empty()) write_json(to_json(a, robot, o, trials, session), a.json);
  if (o.error.empty()) return 0;
  std::fprintf(stderr, "equipoise: %s; motors are off\n", o.error.c_str());
  return 1;
}

}  // namespace equipoise::app
