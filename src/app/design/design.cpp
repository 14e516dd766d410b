#include <cstdio>

#include "app/cli/commands.hpp"
#include "app/design/steady_spin.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string config;
  std::vector<std::string> set;
  std::string estimator;
  std::string controller;
  double last_hz = 3.0;
  double step_hz = 0.5;
  bool bode = false;
  std::string json;
};

constexpr double kSlow_rad_s = 0.5;  // biases of the filter are slower, and than the answers are long

constexpr std::array<const char*, 3> kBrokenAt{"u", "gyro", "encoder"};

nlohmann::json number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json to_json(const Margins& m) {
  return {{"gain_up_dB", number(m.gain_up_dB)},
          {"gain_down_dB", number(m.gain_down_dB)},
          {"phase_deg", number(m.phase_deg)},
          {"delay_ms", number(1e3 * m.delay_s)},
          {"disk", number(m.disk)}};
}

nlohmann::json to_json(const Complex& value) { return nlohmann::json::array({value.real(), value.imag()}); }

template <class Values>
nlohmann::json complex_list(const Values& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const Complex& value : values) list.push_back(to_json(value));
  return list;
}

/// One yaw rate: margins of the loop broken at each place.
template <class Controller>
nlohmann::json judged(const Plant& plant, const Controller& settled, bool bode) {
  const Loop loop = whole_loop(plant, AboutSteadySpin<Controller>(settled));
  nlohmann::json row{{"stable", loop.stable}};
  const std::array<const std::vector<Complex>*, 3> L{&loop.at_u, &loop.at_gyro, &loop.at_encoder};
  for (std::size_t i = 0; i < L.size(); ++i) {
    row["margins"][kBrokenAt[i]] =
        to_json(margins(loop.omega_rad_s, *L[i], plant.centre_rad_s(), kSlow_rad_s));
    if (bode) row["loop"][kBrokenAt[i]] = complex_list(*L[i]);
  }
  if (bode) row["omega_rad_s"] = loop.omega_rad_s;
  return row;
}

nlohmann::json plant_json(const CMatrix& A, const CMatrix& b, const CMatrix& K, double delay_s) {
  const SampledSystem s = sampled(A, b, kTickS, delay_s);
  nlohmann::json rows = nlohmann::json::array();
  for (Eigen::Index i = 0; i < A.rows(); ++i) rows.push_back(complex_list(Eigen::VectorXcd(A.row(i))));
  return {{"A", rows},
          {"b", complex_list(Eigen::VectorXcd(b.col(0)))},
          {"K", complex_list(Eigen::VectorXcd(K.row(0)))},
          {"poles", complex_list(closed_loop_poles(s, K))}};
}

template <std::size_t N>
std::size_t index_of(const std::array<const char*, N>& names, const std::string& name) {
  for (std::size_t i = 0; i < N; ++i) {
    if (name == names[i]) return i;
  }
  throw ConfigError("--estimator " + name + ": not known to this robot");
}

std::vector<double> yaw_rates(const Arguments& a) {
  std::vector<double> hz;
  for (int i = 0; i * a.step_hz <= a.last_hz + 1e-9; ++i) hz.push_back(i * a.step_hz);
  return hz;
}

nlohmann::json mbbr_design(const Arguments& a) {
  Loaded<MbbrConfig> loaded = load_mbbr(a.config, a.set);
  MbbrConfig& c = loaded.config;
  const std::string estimator = a.estimator.empty() ? "ekf" : a.estimator;
  c.estimators.active = static_cast<MbbrEstimatorId>(index_of(kMbbrEstimatorNames, estimator));
  const bool thesis = a.controller == "thesis";
  if (!thesis && !a.controller.empty() && a.controller != "scheduled")
    throw ConfigError("--controller " + a.controller + ": allowed: thesis, scheduled");

  const MbbrGains& g = c.scheduled.gains;
  nlohmann::json out{{"robot", "mbbr"},
                     {"estimator", estimator},
                     {"controller", thesis ? "thesis" : "scheduled"},
                     {"config_sha256", loaded.sha256},
                     {"gains",
                      {{"speed", g.speed},
                       {"speed_turn", g.speed_turn},
                       {"lean", g.lean},
                       {"drive", g.drive},
                       {"yaw_angle", g.yaw_angle},
                       {"yaw_rate", g.yaw_rate},
                       {"yaw_feedforward", g.yaw_feedforward}}}};
  for (const double hz : yaw_rates(a)) {
    const double yaw_rate = 2.0 * kPi * hz;
    const Plant plant = mbbr_plant(c.robot, yaw_rate, c.chain);
    nlohmann::json row =
        thesis ? judged(plant, MbbrController<MbbrThesisFeedback>(c, c.thesis, yaw_rate), a.bode)
               : judged(plant, MbbrController<MbbrScheduledFeedback>(c, c.scheduled, yaw_rate), a.bode);
    row["yaw_hz"] = hz;
    const MbbrLinear linear = mbbr_linear(c.robot, yaw_rate);
    const CMatrix K = mbbr_lqr(c.robot, c.design, yaw_rate);
    row["lqr"] = plant_json(linear.A, linear.b, K, c.design.input_delay_s);
    out["rows"].push_back(row);
  }
  return out;
}

nlohmann::json to_json(const SecondOrder& d) {
  return {{"numerator", {d.b0, d.b1, d.b2}}, {"denominator", {1.0, d.a1, d.a2}}};
}

nlohmann::json mip_design(const Arguments& a) {
  Loaded<MipConfig> loaded = load_mip(a.config, a.set);
  MipConfig& c = loaded.config;
  const std::string estimator = a.estimator.empty() ? "ekf" : a.estimator;
  c.estimators.active = static_cast<MipEstimatorId>(index_of(kMipEstimatorNames, estimator));
  const bool lqr = a.controller == "lqr";
  if (!lqr && !a.controller.empty() && a.controller != "slc")
    throw ConfigError("--controller " + a.controller + ": allowed: slc, lqr");

  // Margins are those of the loop inside its limits.
  constexpr double kUnlimited = 1e9;
  c.reference.max_phi_error_rad = kUnlimited;
  c.slc.max_lean_rad = c.slc.max_u = c.lqr.max_lean_rad = c.lqr.max_u = kUnlimited;

  const MipGains& g = c.slc.gains;
  nlohmann::json out{{"robot", "mip"},
                     {"estimator", estimator},
                     {"controller", lqr ? "lqr" : "slc"},
                     {"config_sha256", loaded.sha256},
                     {"gains",
                      {{"D1", to_json(g.slc.D1)},
                       {"D2", to_json(g.slc.D2)},
                       {"lqr", {g.lqr.theta, g.lqr.phi, g.lqr.theta_dot, g.lqr.phi_dot, g.lqr.u_before}},
                       {"speed", g.speed},
                       {"yaw_angle", g.yaw.angle},
                       {"yaw_rate", g.yaw.rate},
                       {"yaw_feedforward", g.yaw.feedforward}}}};
  CMatrix K(1, 5);
  K << g.lqr.theta, g.lqr.phi, g.lqr.theta_dot, g.lqr.phi_dot, -g.lqr.u_before;
  for (const double hz : yaw_rates(a)) {
    const double yaw_rate = 2.0 * kPi * hz;
    const Plant plant = mip_plant(c.robot, yaw_rate, c.chain);
    nlohmann::json row = lqr ? judged(plant, MipController<MipLqrFeedback>(c, c.lqr, yaw_rate), a.bode)
                             : judged(plant, MipController<MipSlcFeedback>(c, c.slc, yaw_rate), a.bode);
    row["yaw_hz"] = hz;
    const MipLinear linear = mip_linear(c.robot, yaw_rate);
    row["lqr"] = plant_json(linear.A, linear.b, K, c.design.input_delay_s);
    out["rows"].push_back(row);
  }
  return out;
}

void print(const nlohmann::json& d) {
  std::printf("%s, %s on %s\n", d["robot"].get<std::string>().c_str(),
              d["controller"].get<std::string>().c_str(), d["estimator"].get<std::string>().c_str());
  std::printf("yaw, Hz  broken at       gain, dB        phase, deg  further delay, ms  disk\n");
  const auto value = [](const nlohmann::json& v) { return v.is_null() ? HUGE_VAL : v.get<double>(); };
  for (const nlohmann::json& row : d["rows"]) {
    for (const char* place : kBrokenAt) {
      const nlohmann::json& m = row["margins"][place];
      std::printf("%7.2f  %-9s  %+7.1f  %+7.1f    %10.1f  %17.1f  %5.2f%s\n", row["yaw_hz"].get<double>(),
                  place, -std::abs(value(m["gain_down_dB"])), value(m["gain_up_dB"]), value(m["phase_deg"]),
                  value(m["delay_ms"]), value(m["disk"]), row["stable"].get<bool>() ? "" : "  UNSTABLE");
    }
  }
}

}  // namespace

void add_design(Subcommand app) {
  const Subcommand command = app.subcommand(
      "design", "Gains of a configuration, and the margins of the loop with filter and delays in it");
  auto a = std::make_shared<Arguments>();
  command.option("--config", a->config, "robot configuration, TOML").required();
  command.option("--set", a->set, "override a configuration key");
  command.option("--estimator", a->estimator, "filter in the loop (default: ekf)");
  command.option("--controller", a->controller, "mbbr: thesis, scheduled; mip: slc, lqr");
  command.option("--last-hz", a->last_hz, "highest yaw rate").show_default().range(0.0, 10.0);
  command.option("--step-hz", a->step_hz, "between yaw rates").show_default().range(0.01, 10.0);
  command.flag("--bode", a->bode, "with the frequency responses, in the JSON");
  command.option("--json", a->json, "output file, - for stdout");
  command.action([a] {
    const std::string type = robot_type(a->config);
    if (type != "mbbr" && type != "mip")
      throw ConfigError(a->config + ": robot.type: \"" + type + "\" has no design; allowed: mbbr, mip");
    const nlohmann::json design = type == "mbbr" ? mbbr_design(*a) : mip_design(*a);
    if (!a->json.empty()) write_json(design, a->json);
    if (a->json != "-") print(design);
    return 0;
  });
}

}  // namespace equipoise::app
