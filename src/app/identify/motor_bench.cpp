#include "equipoise/plant/motor_bench.hpp"

#include <fstream>
#include <memory>

#include "app/cli/commands.hpp"
#include "app/cli/progress.hpp"
#include "app/identify/bench_log.hpp"
#include "app/text/files.hpp"
#include "app/text/json.hpp"

namespace equipoise::app {
namespace {

struct MotorBenchArguments {
  std::vector<int> motors{1, 2, 3};
  std::vector<int> drivers{1, 2, 3};
  std::vector<double> pwm_hz{kBenchPwm_hz.begin(), kBenchPwm_hz.end()};
  std::string mode = "drive_coast";
  double inertia_kg_m2 = SwitchedMotorParams{}.inertia_kg_m2;
  std::uint64_t seed = 1;
  bool locked_step = false;
  std::string log;
  std::string trace;
  std::string json;
};

nlohmann::json to_json(const BenchFit& f) {
  return {{"r_squared", f.r_squared}, {"rmse_over_stall", f.rmse_over_stall}};
}

void write_log(const std::string& path, BridgeType bridge, const std::vector<BenchSample>& samples) {
  BenchLog log;
  log.bridge = bridge == BridgeType::kDriveBrake ? LoggedBridge::kDriveBrake : LoggedBridge::kDriveCoast;
  log.rows = samples;
  write_bench_log(path, log);
}

void write_trace(const std::string& path, const std::vector<BenchSample>& log,
                 const std::vector<double>& coast, const std::vector<double>& linear) {
  check_output(path, {"t_s,"}, "trace");
  std::ofstream file(path);
  file << "t_s,u,supply_V,angle_rad,current_A,drive_coast_A,linear_A\n";
  for (std::size_t i = 0; i < log.size(); ++i) {
    const BenchSample& s = log[i];
    file << s.t_s << ',' << s.u << ',' << s.supply_V << ',' << s.angle_rad << ',' << s.current_A << ','
         << coast[i] << ',' << linear[i] << '\n';
  }
  if (!file.flush()) throw InputError(path + ": cannot be written");
}

int run(const MotorBenchArguments& a) {
  const std::size_t cases = a.motors.size() * a.drivers.size() * a.pwm_hz.size();
  if ((!a.log.empty() || !a.trace.empty()) && cases != 1) {
    throw InputError("--log and --trace want one --motor, one --driver and one --pwm-hz");
  }
  const std::vector<double> u = bench_sequence(BenchParams{}.sample_hz, 1);
  nlohmann::json rows = nlohmann::json::array();
  BenchFit coast_sum;
  BenchFit linear_sum;
  Progress progress("motor-bench");
  std::size_t done = 0;
  for (const int motor : a.motors) {
    for (const int driver : a.drivers) {
      for (const double hz : a.pwm_hz) {
        progress.at(static_cast<double>(done++) / static_cast<double>(cases));
        BenchParams p;
        p.seed = a.seed;
        p.motor = bench_motor(static_cast<std::size_t>(motor - 1), static_cast<std::size_t>(driver - 1), hz);
        p.motor.inertia_kg_m2 = a.inertia_kg_m2;
        p.motor.bridge = a.mode == "drive_brake" ? BridgeType::kDriveBrake : BridgeType::kDriveCoast;
        if (a.locked_step) {
          constexpr double kScope_hz = 200e3;
          constexpr std::size_t kScope = 2000;
          write_log(a.log, p.motor.bridge, run_locked_step(p, kScope_hz, kScope));
          continue;
        }
        const std::vector<BenchSample> log = run_bench(p, u);
        const std::vector<double> coast = predict_current(p.motor, log, CurrentModel::kDriveCoast);
        const std::vector<double> linear = predict_current(p.motor, log, CurrentModel::kLinear);
        const BenchFit coast_fit = fit(p.motor, log, coast);
        const BenchFit linear_fit = fit(p.motor, log, linear);
        coast_sum.r_squared += coast_fit.r_squared;
        coast_sum.rmse_over_stall += coast_fit.rmse_over_stall;
        linear_sum.r_squared += linear_fit.r_squared;
        linear_sum.rmse_over_stall += linear_fit.rmse_over_stall;
        rows.push_back({{"motor", motor},
                        {"driver", driver},
                        {"pwm_hz", hz},
                        {"drive_coast", to_json(coast_fit)},
                        {"linear", to_json(linear_fit)}});
        if (!a.log.empty()) write_log(a.log, p.motor.bridge, log);
        if (!a.trace.empty()) write_trace(a.trace, log, coast, linear);
      }
    }
  }
  if (rows.empty()) return 0;
  const auto n = static_cast<double>(rows.size());
  const nlohmann::json mean{
      {"drive_coast", to_json({coast_sum.r_squared / n, coast_sum.rmse_over_stall / n})},
      {"linear", to_json({linear_sum.r_squared / n, linear_sum.rmse_over_stall / n})}};
  if (!a.json.empty()) {
    write_json({{"mode", a.mode},
                {"seed", a.seed},
                {"inertia_kg_m2", a.inertia_kg_m2},
                {"rows", rows},
                {"mean", mean}},
               a.json);
    return 0;
  }
  std::printf("%5s %6s %8s %14s %14s\n", "motor", "driver", "PWM, Hz", "R2 drive/coast", "R2 linear");
  for (const auto& r : rows) {
    std::printf("%5d %6d %8.0f %14.3f %14.3f\n", r["motor"].get<int>(), r["driver"].get<int>(),
                r["pwm_hz"].get<double>(), r["drive_coast"]["r_squared"].get<double>(),
                r["linear"]["r_squared"].get<double>());
  }
  std::printf("mean %31.3f %14.3f\n", coast_sum.r_squared / n, linear_sum.r_squared / n);
  return 0;
}

}  // namespace

void add_motor_bench(Subcommand app) {
  const Subcommand command =
      app.subcommand("motor-bench",
                     "Simulated motor dynamometer at PWM resolution: current models against the sensor")
          .example("equipoise motor-bench --motor 1 --driver 1 --pwm-hz 20000 --log bench.lcm");
  auto a = std::make_shared<MotorBenchArguments>();
  command.option("--motor", a->motors, "1 to 3, [T] Table 4.2 (default: all)").range(1, 3);
  command.option("--driver", a->drivers, "1 to 3, [T] Table 4.2 (default: all)").range(1, 3);
  command.option("--pwm-hz", a->pwm_hz, "PWM frequencies, Hz (default: 500 to 20000)").range(100.0, 100e3);
  command.option("--mode", a->mode, "drive_coast or drive_brake")
      .show_default()
      .one_of({"drive_coast", "drive_brake"});
  command.option("--inertia-kg-m2", a->inertia_kg_m2, "of the flywheel, at the motor's output")
      .show_default()
      .range(1e-5, 1.0);
  command.option("--seed", a->seed, "seed of the sensors' noise").show_default();
  const Option log = command.option("--log", a->log, "LCM event log of one case, for identify motor").file();
  command.flag("--locked-step", a->locked_step, "log a step with the shaft locked, at 200 kHz").needs(log);
  command.option("--trace", a->trace, "CSV of one case: measured and predicted currents").file();
  command.option("--json", a->json, "output file, - for stdout").file();
  command.action([=] { return run(*a); });
}

}  // namespace equipoise::app
