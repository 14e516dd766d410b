#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <thread>

#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/cli/reasons.hpp"
#include "app/log/log_name.hpp"
#include "app/sim/simulate.hpp"
#include "config/population.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string config;
  SimOptions options;
  Choice choice;
  double yaw_hz = 0.0;
  std::vector<std::string> set;
  std::int64_t robot = 0;
  std::string log;
  std::string json;
  bool realtime = false;
  std::string telemetry = runtime::kDefaultTelemetryUrl;
};

template <class Firmware>
nlohmann::json to_json(const Arguments& a, const SimSummary& s, const std::string& config_sha256) {
  nlohmann::json estimators = nlohmann::json::object();
  for (const auto& [name, errors] : s.estimators) {
    estimators[name] = {{"attitude_rmse_rad", errors.attitude_rmse_rad},
                        {Firmware::kSpeedRmseKey, errors.speed_rmse}};
  }
  nlohmann::json out{{"robot", Firmware::kName},
                     {"robot_number", a.robot},
                     {"seed", a.options.seed},
                     {"estimator", a.choice.estimator},
                     {"controller", a.choice.controller},
                     {"fidelity", a.choice.fidelity},
                     {"attitude", a.choice.attitude},
                     {"yaw_hz", a.options.yaw_rate_rad_s / (2.0 * kPi)},
                     {"drive_mps", a.options.drive_mps},
                     {"duration_s", static_cast<double>(s.ticks) * kTickS},
                     {"attitude_rmse_rad", s.controlling.attitude_rmse_rad},
                     {Firmware::kSpeedRmseKey, s.controlling.speed_rmse},
                     {"yaw_frame_speed_rmse_m_s", s.yaw_frame_speed_rmse_m_s},
                     {"heading_error_rad", s.heading_error_rad},
                     {"position_rmse_m", s.position_rmse_m},
                     {"yaw_rate_mean_hz", s.yaw_rate_mean_hz},
                     {"duty_max", s.duty_max},
                     {"saturated_fraction", s.saturated_fraction},
                     {"ticks", s.ticks},
                     {"real_time_factor", s.real_time_factor},
                     {"interrupted", s.verdict.ended == Ended::kInterrupted},
                     {"degraded", degraded_names(s.degraded)},
                     {"log", a.log},
                     {"estimators", estimators},
                     {"config_sha256", config_sha256},
                     {"version", version()}};
  s.verdict.write(&out);
  return out;  // NaN, never counted, is written as null
}

/// A number, or a dash where nothing was counted.
std::string shown(const char* format, double value) {
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return std::isnan(value) ? "       -" : text;
}

template <class Firmware>
void print_summary(std::FILE* out, const Arguments& a, const SimSummary& s) {
  std::fprintf(out, "%s  (%s, %s, %s, %s, seed %llu)\n", s.verdict.sentence().c_str(), Firmware::kName,
               a.choice.estimator.c_str(), a.choice.controller.c_str(), a.choice.fidelity.c_str(),
               static_cast<unsigned long long>(a.options.seed));
  const auto line = [out](const char* label, const std::string& value, const char* unit) {
    std::fprintf(out, "  %-15s %s %s\n", label, value.c_str(), unit);
  };
  line("yaw rate", shown("%8.3f", s.yaw_rate_mean_hz), "Hz");
  line("attitude RMSE", shown("%8.4f", s.controlling.attitude_rmse_rad), "rad");
  line(Firmware::kSpeedLabel, shown("%7.2f", Firmware::kSpeedScale * s.controlling.speed_rmse),
       Firmware::kSpeedUnit);
  line("position RMSE", shown("%8.3f", s.position_rmse_m), "m");
  line("heading error", shown("%8.3f", s.heading_error_rad), "rad, at the end");
  std::fprintf(out, "  duty max        %8.3f, saturated %.2f %% of the time\n", s.duty_max,
               100.0 * s.saturated_fraction);
  std::fprintf(out, "  simulated at    %8.0f x real time\n", s.real_time_factor);
  if (s.estimators.size() > 1) {
    std::fprintf(out, "  %-18s %14s %12s, %s\n", "estimator", "attitude, rad", "speed", Firmware::kSpeedUnit);
    for (const auto& [name, e] : s.estimators) {
      std::fprintf(out, "  %-18s %14s %18s\n", name.c_str(), shown("%.4f", e.attitude_rmse_rad).c_str(),
                   shown("%.2f", Firmware::kSpeedScale * e.speed_rmse).c_str());
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

template <class Firmware>
int run(Arguments a) {
  complete<Firmware>(a.choice);
  const typename Firmware::Loaded loaded = Firmware::load(
      a.config, config::with_robot_drawn(config::draw_robot(a.config, a.set, a.choice.fidelity, a.robot),
                                         a.choice.fidelity, a.set));
  if (a.log.empty()) a.log = new_log_name("sim", Firmware::kName);

  runtime::TelemetryOptions telemetry_options;
  telemetry_options.log_path = a.log == "off" ? "" : a.log;
  telemetry_options.url = a.telemetry == "off" ? "" : a.telemetry;
  telemetry_options.wait_when_full = !a.realtime;
  if (a.realtime) telemetry_options.max_publish_hz = 2.0 * kTickHz;
  telemetry_options.estimators = Firmware::estimators();
  telemetry_options.run = run_info<Firmware>(loaded, a.choice, static_cast<std::int64_t>(a.options.seed));
  telemetry_options.run.backend = "sim";
  runtime::Telemetry telemetry(telemetry_options);

  watch_interrupts();
  std::FILE* const out = a.json == "-" ? stderr : stdout;
  Pace pace(a.realtime, a.options.duration_s, stderr);
  a.options.log_failed = &telemetry.log_failed();
  const SimSummary summary = simulate<Firmware>(
      loaded.config, a.choice, a.options,
      [&](const runtime::TickRecord& record) {
        telemetry.hand_over(record);
        pace.show(record);
      },
      interrupted);
  pace.end();
  const runtime::TelemetryReport report = telemetry.finish();
  if (!report.warning.empty()) std::fprintf(stderr, "equipoise: warning: %s\n", report.warning.c_str());

  print_summary<Firmware>(out, a, summary);
  std::fprintf(out, "  log             %s\n", a.log.c_str());
  if (!a.json.empty()) write_json(to_json<Firmware>(a, summary, loaded.sha256), a.json);
  if (!report.log_error.empty()) {
    std::fprintf(stderr, "equipoise: %s\n", report.log_error.c_str());
    return 1;
  }
  return summary.verdict.fell() ? 1 : 0;
}

int run(const Arguments& a) {
  return with_robot(robot_type(a.config), a.config,
                    [&](auto firmware) { return run<decltype(firmware)>(a); });
}

}  // namespace

void add_sim(Subcommand app) {
  const Subcommand command = app.subcommand("sim", "Simulates the robot through the production pipeline");
  auto a = std::make_shared<Arguments>();
  command.option("--config", a->config, "robot configuration, TOML").required();
  const Option yaw_hz = command.option("--yaw-hz", a->yaw_hz, "yaw rate, turns per second");
  yaw_hz.range(-5.0, 5.0);
  command.option("--yaw-rad-s", a->options.yaw_rate_rad_s, "yaw rate, rad/s")
      .range(-10.0 * kPi, 10.0 * kPi)
      .excludes(yaw_hz);
  command.option("--drive-mps", a->options.drive_mps, "drive speed, m/s").range(-2.0, 2.0);
  command.option("--duration-s", a->options.duration_s, "simulated time, s")
      .show_default()
      .range(0.01, 360000.0);
  command.option("--seed", a->options.seed, "seed of every random number").show_default();
  command.option("--estimator", a->choice.estimator, "which estimator controls: " + known_estimators());
  command.option("--controller", a->choice.controller, known_controllers());
  a->choice.fidelity = "nominal";
  command.option("--fidelity", a->choice.fidelity, "ideal, thesis, nominal, full")
      .show_default()
      .one_of(kFidelityNames);
  command
      .option("--robot", a->robot,
              "draw this robot from [population] of the configuration; 0: the typical one")
      .show_default()
      .range(0.0, 1e12);
  a->choice.attitude = "dmp";
  command.option("--attitude", a->choice.attitude, "attitude source: dmp (packets), own (our filter)")
      .show_default()
      .one_of({"dmp", "own"});
  command.option("--set", a->set, "override a configuration key, e.g. --set friction.compensation=0.8");
  command.flag("--compare", a->choice.compare, "run every estimator on the same samples");
  command.option("--log", a->log, "LCM event log, or off (default: logs/sim-ROBOT-TIME.lcm)");
  command.option("--json", a->json, "summary as JSON, - for stdout");
  command.flag("--realtime", a->realtime, "pace to wall-clock time");
  command.option("--telemetry", a->telemetry, "LCM provider URL, or off").show_default();
  command.action([=] {
    if (yaw_hz.given()) a->options.yaw_rate_rad_s = 2.0 * kPi * a->yaw_hz;
    return run(*a);
  });
}

}  // namespace equipoise::app
