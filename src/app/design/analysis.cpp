#include "app/design/analysis.hpp"

#include "app/design/steady_spin.hpp"

namespace equipoise::app {
namespace {

constexpr double kSlow_rad_s = 0.5;  // biases of the filter are slower, and than the answers are long

constexpr double kUnlimited = 1e9;  // margins are those of the loop inside its limits

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

nlohmann::json complex_list(const Eigen::VectorXcd& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const Complex& value : values) list.push_back(to_json(value));
  return list;
}

/// One yaw rate: margins of the loop broken at each place.
nlohmann::json judged(const Plant& plant, const SettledController& settled, bool bode) {
  const Loop loop = whole_loop(plant, settled);
  nlohmann::json row{{"stable", loop.stable}};
  const std::array<const std::vector<Complex>*, 3> L{&loop.at_u, &loop.at_gyro, &loop.at_encoder};
  for (std::size_t i = 0; i < L.size(); ++i) {
    row["margins"][kBrokenAt[i]] =
        to_json(margins(loop.omega_rad_s, *L[i], plant.centre_rad_s(), kSlow_rad_s));
    if (bode)
      row["loop"][kBrokenAt[i]] = complex_list(
          Eigen::Map<const Eigen::VectorXcd>(L[i]->data(), static_cast<Eigen::Index>(L[i]->size())));
  }
  if (bode) row["omega_rad_s"] = loop.omega_rad_s;
  return row;
}

nlohmann::json plant_json(const CMatrix& A, const CMatrix& b, const CMatrix& K, double delay_s) {
  const SampledSystem s = sampled(A, b, kTickS, delay_s);
  nlohmann::json rows = nlohmann::json::array();
  for (Eigen::Index i = 0; i < A.rows(); ++i) rows.push_back(complex_list(A.row(i)));
  return {{"A", rows},
          {"b", complex_list(b.col(0))},
          {"K", complex_list(K.row(0))},
          {"poles", complex_list(closed_loop_poles(s, K))}};
}

std::size_t index_of(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw ConfigError("--estimator " + name + ": not known to this robot");
  return static_cast<std::size_t>(found - names.begin());
}

/// The controller asked for; the first where none is.
std::string controller_of(const DesignRequest& a, const std::array<const char*, 2>& known) {
  if (a.controller.empty()) return known[0];
  if (a.controller != known[0] && a.controller != known[1])
    throw ConfigError("--controller " + a.controller + ": allowed: " + known[0] + ", " + known[1]);
  return a.controller;
}

std::string estimator_of(const DesignRequest& a) { return a.estimator.empty() ? "ekf" : a.estimator; }

/// Adds to `out`, which holds what is the robot's own, the choices and row_at(yaw rate, rad/s) for each one.
nlohmann::json with_rows(const DesignRequest& a, const std::string& controller, const std::string& sha256,
                         nlohmann::json out, const std::function<nlohmann::json(double)>& row_at) {
  out["estimator"] = estimator_of(a);
  out["controller"] = controller;
  out["config_sha256"] = sha256;
  for (int i = 0; i * a.step_hz <= a.last_hz + 1e-9; ++i) {
    const double hz = i * a.step_hz;
    if (a.progress) a.progress(hz / (a.last_hz + a.step_hz));
    nlohmann::json row = row_at(2.0 * kPi * hz);
    row["yaw_hz"] = hz;
    out["rows"].push_back(row);
  }
  return out;
}

nlohmann::json mbbr_design(const DesignRequest& a) {
  Loaded<MbbrConfig> loaded = load_mbbr(a.config, a.set);
  MbbrConfig& c = loaded.config;
  c.estimators.active = static_cast<MbbrEstimatorId>(
      index_of({kMbbrEstimatorNames.begin(), kMbbrEstimatorNames.end()}, estimator_of(a)));
  const std::string controller = controller_of(a, {"scheduled", "thesis"});
  c.reference.budget = DutyBudget{};

  const MbbrGains& g = c.scheduled.gains;
  const nlohmann::json out{{"robot", "mbbr"},
                           {"gains",
                            {{"speed", g.speed},
                             {"speed_turn", g.speed_turn},
                             {"lean", g.lean},
                             {"drive", g.drive},
                             {"yaw_angle", g.yaw_angle},
                             {"yaw_rate", g.yaw_rate},
                             {"yaw_feedforward", g.yaw_feedforward}}}};
  return with_rows(a, controller, loaded.sha256, out, [&](double yaw_rate) {
    const Plant plant = mbbr_plant(c.robot, yaw_rate, c.chain);
    nlohmann::json row =
        controller == "thesis"
            ? judged(plant, SettledControllerOf<MbbrSpin, MbbrThesisFeedback>(c, c.thesis, yaw_rate), a.bode)
            : judged(plant, SettledControllerOf<MbbrSpin, MbbrScheduledFeedback>(c, c.scheduled, yaw_rate),
                     a.bode);
    const MbbrLinear linear = mbbr_linear(c.robot, yaw_rate);
    const CMatrix K = mbbr_lqr(c.robot, c.design, yaw_rate);
    row["lqr"] = plant_json(linear.A, linear.b, K, c.design.input_delay_s);
    return row;
  });
}

nlohmann::json to_json(const SecondOrder& d) {
  return {{"numerator", {d.b0, d.b1, d.b2}}, {"denominator", {1.0, d.a1, d.a2}}};
}

nlohmann::json mip_design(const DesignRequest& a) {
  Loaded<MipConfig> loaded = load_mip(a.config, a.set);
  MipConfig& c = loaded.config;
  c.estimators.active = static_cast<MipEstimatorId>(
      index_of({kMipEstimatorNames.begin(), kMipEstimatorNames.end()}, estimator_of(a)));
  const std::string controller = controller_of(a, {"slc", "lqr"});
  c.reference.budget = DutyBudget{};
  c.reference.max_phi_error_rad = kUnlimited;
  c.slc.max_lean_rad = c.slc.max_u = c.lqr.max_lean_rad = c.lqr.max_u = kUnlimited;

  const MipGains& g = c.slc.gains;
  const nlohmann::json out{
      {"robot", "mip"},
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
  return with_rows(a, controller, loaded.sha256, out, [&](double yaw_rate) {
    const Plant plant = mip_plant(c.robot, yaw_rate, c.chain);
    nlohmann::json row =
        controller == "lqr"
            ? judged(plant, SettledControllerOf<MipSpin, MipLqrFeedback>(c, c.lqr, yaw_rate), a.bode)
            : judged(plant, SettledControllerOf<MipSpin, MipSlcFeedback>(c, c.slc, yaw_rate), a.bode);
    const MipLinear linear = mip_linear(c.robot, yaw_rate);
    row["lqr"] = plant_json(linear.A, linear.b, K, c.design.input_delay_s);
    return row;
  });
}

}  // namespace

nlohmann::json design(const DesignRequest& request) {
  const std::string type = robot_type(request.config);
  if (type == "mbbr") return mbbr_design(request);
  if (type == "mip") return mip_design(request);
  throw ConfigError(request.config + ": robot.type: \"" + type + "\" has no design; allowed: mbbr, mip");
}

}  // namespace equipoise::app
