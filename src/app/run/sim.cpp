#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <thread>

#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/sim/sim_job.hpp"
#include "app/text/files.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  SimRequest request;
  double yaw_hz = 0.0;
  std::string log;
  std::string json;
  bool realtime = false;
  std::string telemetry = runtime::kDefaultTelemetryUrl;
};

/// A number, or a dash where nothing was counted.
std::string shown(const char* format, double value) {
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return std::isnan(value) ? "       -" : text;
}

void print_summary(std::FILE* out, const ConfiguredRobot& configured, const SimRequest& r,
                   const SimSummary& s) {
  const RobotType& robot = *configured.type;
  std::fprintf(out, "%s  (%s, %s, %s, %s, seed %llu)\n", s.verdict.sentence().c_str(), robot.name,
               r.choice.estimator.c_str(), r.choice.controller.c_str(), r.choice.fidelity.c_str(),
               static_cast<unsigned long long>(r.seed));
  print_reasons(out, s.verdict, configured.safety);
  const auto line = [out](const char* label, const std::string& value, const char* unit) {
    std::fprintf(out, "  %-15s %s %s\n", label, value.c_str(), unit);
  };
  line("yaw rate", shown("%8.3f", s.yaw_rate_mean_hz), "Hz");
  line("attitude RMSE", shown("%8.4f", s.controlling.attitude_rmse_rad), "rad");
  line(robot.speed_label, shown("%7.2f", robot.speed_scale * s.controlling.speed_rmse), robot.speed_unit);
  line("position RMSE", shown("%8.3f", s.position_rmse_m), "m");
  if (!r.path.empty()) line("off the path", shown("%8.3f", s.path_rmse_m), "m RMS");
  line("heading error", shown("%8.3f", s.heading_error_rad), "rad, at the end");
  std::fprintf(out, "  duty max        %8.3f, saturated %.2f %% of the time\n", s.duty_max,
               100.0 * s.saturated_fraction);
  std::fprintf(out, "  simulated at    %8.0f x real time\n", s.real_time_factor);
  if (s.estimators.size() > 1) {
    std::fprintf(out, "  %-18s %14s %12s, %s\n", "estimator", "attitude, rad", "speed", robot.speed_unit);
    for (const auto& [name, e] : s.estimators) {
      std::fprintf(out, "  %-18s %14s %18s\n", name.c_str(), shown("%.4f", e.attitude_rmse_rad).c_str(),
                   shown("%.2f", robot.speed_scale * e.speed_rmse).c_str());
    }
  }
}

/// Wall-clock pacing and a progress line, on the simulation's own thread.
class Pace {
 public:
  Pace(bool realtime, double duration_s, std::FILE* out)
      : realtime_(realtime), duration_s_(duration_s), out_(isatty(fileno(out)) != 0 ? out : nullptr) {}

  void show(const runtime::TickRecord& r) {
    const double t = static_cast<double>(r.now_ns) * 1e-9;
    if (realtime_)
      std::this_thread::sleep_until(
          start_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(t)));
    if (out_ == nullptr || t < next_line_s_) return;
    next_line_s_ = t + duration_s_ / 100.0;
    std::fprintf(out_, "\r%6.1f / %.1f s  tilt %+.3f %+.3f rad  yaw %+6.2f rad/s  ", t, duration_s_,
                 r.estimate.theta_rad[0], r.estimate.theta_rad[1], r.estimate.omega_B_rad_s[2]);
    std::fflush(out_);
  }
  void end() {
    if (out_ != nullptr) std::fprintf(out_, "\r%70s\r", "");
  }

 private:
  using Clock = std::chrono::steady_clock;
  bool realtime_;
  double duration_s_;
  std::FILE* out_;
  Clock::time_point start_ = Clock::now();
  double next_line_s_ = 0.0;
};

int run_sim(Arguments a) {
  SimRequest& request = a.request;
  const auto robot = load_for(&request);
  if (a.log.empty()) a.log = new_log_name("sim", robot->type->name);
  watch_interrupts();  // before the log exists: whoever sees it may interrupt

  runtime::TelemetryOptions telemetry_options;
  telemetry_options.log_path = a.log == "off" ? "" : a.log;
  telemetry_options.url = a.telemetry == "off" ? "" : a.telemetry;
  telemetry_options.wait_when_full = !a.realtime;
  if (a.realtime) telemetry_options.max_publish_hz = 2.0 * kTickHz;
  telemetry_options.estimators = robot->type->estimators;
  telemetry_options.run = run_info(*robot, request.choice, static_cast<std::int64_t>(request.seed));
  telemetry_options.run.backend = "sim";
  runtime::Telemetry telemetry(telemetry_options);

  SimOptions options = options_for(request, *robot);
  std::FILE* const out = a.json == "-" ? stderr : stdout;
  Pace pace(a.realtime, options.duration_s, stderr);
  options.log_failed = &telemetry.log_failed();
  const SimSummary summary = simulate(
      *robot, request.choice, options,
      [&](const runtime::TickRecord& record) {
        telemetry.hand_over(record);
        pace.show(record);
      },
      interrupted);
  pace.end();
  const runtime::TelemetryReport report = telemetry.finish(summary.verdict.record());
  if (!report.warning.empty()) std::fprintf(stderr, "equipoise: warning: %s\n", report.warning.c_str());

  print_summary(out, *robot, request, summary);
  std::fprintf(out, "  log             %s\n", a.log.c_str());
  if (!a.json.empty()) {
    nlohmann::json json = app::to_json(request, summary, *robot);
    json["log"] = a.log;
    write_json(json, a.json);
  }
  if (!report.log_error.empty()) {
    std::fprintf(stderr, "equipoise: %s\n", report.log_error.c_str());
    return 1;
  }
  return summary.verdict.fell() ? 1 : 0;
}

}  // namespace

void add_sim(Subcommand app) {
  const Subcommand command =
      app.subcommand("sim", "Simulates the robot through the production pipeline")
          .example("equipoise sim --config config/mbbr.toml --yaw-hz 1 --drive-mps 0.1");
  auto a = std::make_shared<Arguments>();
  SimRequest& r = a->request;
  command.option("--config", r.config, "robot configuration, TOML").file().required();
  const Option yaw_hz = command.option("--yaw-hz", a->yaw_hz, "yaw rate, turns per second");
  yaw_hz.range(-kMostYaw_hz, kMostYaw_hz);
  command.option("--yaw-rad-s", r.yaw_rate_rad_s, "yaw rate, rad/s")
      .range(-2.0 * kPi * kMostYaw_hz, 2.0 * kPi * kMostYaw_hz)
      .excludes(yaw_hz);
  command.option("--drive-mps", r.drive_mps, "drive speed, m/s").range(-kMostDrive_mps, kMostDrive_mps);
  command.option("--path", r.path, kPathHelp).excludes(yaw_hz);
  command.option("--duration-s", r.duration_s, "simulated time, s")
      .show_default()
      .range(kShortest_s, kLongest_s);
  command.option("--seed", r.seed, "seed of every random number").show_default();
  command.option("--estimator", r.choice.estimator, "which estimator controls: " + known_estimators());
  command.option("--controller", r.choice.controller, "which controller balances: " + known_controllers());
  command.option("--fidelity", r.choice.fidelity, "the simulated world")
      .show_default()
      .one_of(kFidelityNames);
  command
      .option("--robot", r.robot,
              "draw this robot from [population] of the configuration; 0: the typical one")
      .show_default()
      .range(0.0, 1e12);
  command.option("--attitude", r.choice.attitude, "attitude source: dmp (packets), own (our filter)")
      .show_default()
      .one_of({"dmp", "own"});
  command.option("--set", r.set, "override a configuration key, e.g. --set friction.compensation=0.8");
  command.flag("--compare", r.choice.compare, "run every estimator on the same samples");
  command.option("--log", a->log, "LCM event log, or off (default: logs/sim-ROBOT-TIME.lcm)").file();
  command.option("--json", a->json, "summary as JSON, - for stdout").file();
  command.flag("--realtime", a->realtime, "pace to wall-clock time");
  command.option("--telemetry", a->telemetry, "LCM provider URL, or off").show_default();
  command.action([=] {
    if (yaw_hz.given()) a->request.yaw_rate_rad_s = 2.0 * kPi * a->yaw_hz;
    return run_sim(*a);
  });
}

}  // namespace equipoise::app
