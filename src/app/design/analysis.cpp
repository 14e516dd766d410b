#include "app/design/analysis.hpp"

#include <algorithm>

#include "app/design/whole_loop.hpp"
#include "app/trial/firmware.hpp"
#include "equipoise/sense/rotor_speed.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mbbr/high_yaw.hpp"
#include "robots/mip/config.hpp"
#include "robots/mip/models.hpp"

namespace equipoise::app {
namespace {

/// The MBBR's signals at a steady spin; its tick without friction, bridge and safety.
struct MbbrSpin {
  using Config = MbbrConfig;
  using Robot = Mbbr;
  using Estimators = MbbrEstimators;
  using Reference = MbbrReferenceStage;

  static double yaw_acceleration_rad_s2(const MbbrReferenceParams& p) { return p.yaw_acceleration_rad_s2(); }
  static Vec3 told(const MbbrParameters& p, Complex u, double yaw_rate) {
    return {u.real(), u.imag(), -(p.k2_ball + p.mu_v) / p.k1 * yaw_rate};
  }
  static Complex answer(const Vec3& u) { return {u.x(), u.y()}; }
  /// All but the wheels' rates.
  static Mbbr::Sample sample(const MbbrParameters& p, const MbbrKinematics& kinematics,
                             const Readings& readings, double yaw_rate, double heading) {
    const auto xy = [&readings](Channel c) { return Vec2(readings[c].real(), readings[c].imag()); };
    Mbbr::Sample z;
    z.gyro_B_rad_s << xy(kGyro), yaw_rate;
    z.accel_B_m_s2 << yaw_rate * yaw_rate * p.l_a.head<2>() + xy(kAccel), -kGravity_m_s2;
    Vec3 phi_B;
    phi_B << xy(kEncoder), -heading;
    z.wheel_angle_rad = kinematics.wheels_from_ball(phi_B);
    z.attitude_rad << xy(kAttitude), heading;
    return z;
  }
};

/// The MIP's, likewise; real.
struct MipSpin {
  using Config = MipConfig;
  using Robot = Mip;
  using Estimators = MipEstimators;
  using Reference = MipReferenceStage;

  static double yaw_acceleration_rad_s2(const MipReferenceParams& p) { return p.max_yaw_acceleration_rad_s2; }
  static Vec2 told(const MipParameters& p, Complex u, double yaw_rate) {
    return {u.real(), p.yaw_to_wheel() * (p.k2 + p.mu_v) / p.k1 * yaw_rate};
  }
  static Complex answer(const Vec2& u) { return {u.x(), 0.0}; }
  static Mip::Sample sample(const MipParameters& p, const MipKinematics& kinematics, const Readings& readings,
                            double yaw_rate, double heading) {
    Mip::Sample z;
    z.gyro_B_rad_s << readings[kGyro].real(), readings[kGyroAcross].real(), yaw_rate;
    z.accel_B_m_s2 << 0.0, yaw_rate * yaw_rate * p.l_a.y() + readings[kAccel].real(), -kGravity_m_s2;
    z.wheel_angle_rad = kinematics.wheels(readings[kEncoder].real(), heading);
    z.attitude_rad << readings[kAttitude].real(), 0.0, heading;
    return z;
  }
};

template <class Spin, class Feedback>
class SettledControllerOf : public SettledController {
 public:
  SettledControllerOf(const typename Spin::Config& config, const typename Feedback::Params& feedback,
                      double yaw_rate_rad_s)
      : robot_(config.robot),
        kinematics_(config.robot),
        estimators_(in_double(config.estimators)),
        reference_(config.reference),
        feedback_(feedback),
        yaw_step_(Spin::yaw_acceleration_rad_s2(config.reference) * kTickS) {
    for (int k = 0; k < 40; ++k) estimators_.update(sample({}), Input::Zero(), true);
    reference_.reset(estimators_.update(sample({}), Input::Zero(), true));
    command_.arm = true;
    command_.yaw_rate_rad_s = yaw_rate_rad_s;
    constexpr int kSettleTicks = 1200;  // the filters' gains are steady then
    const int ramp = static_cast<int>(std::ceil(std::abs(yaw_rate_rad_s) / yaw_step_));
    for (int k = 0; k < ramp + kSettleTicks; ++k) SettledControllerOf::step({}, {});
  }

  std::unique_ptr<SettledController> copy() const override {
    return std::make_unique<SettledControllerOf>(*this);
  }

  Complex step(const Readings& readings, Complex u_before) override {
    yaw_rate_ += std::clamp(command_.yaw_rate_rad_s - yaw_rate_, -yaw_step_, yaw_step_);
    heading_ += kTickS * yaw_rate_;
    const auto& x_hat = estimators_.update(sample(readings), Spin::told(robot_, u_before, yaw_rate_), false);
    return Spin::answer(feedback_.update(reference_.update(command_, x_hat)));
  }

 private:
  using Robot = typename Spin::Robot;
  using Input = Vec<Robot::kInputs>;
  using Estimators = typename Spin::Estimators;

  /// Single precision would drown a small impulse's answer in the last digit of what it settled at.
  static typename Estimators::Params in_double(typename Estimators::Params params) {
    params.ekf.precision = Precision::kDouble;
    return params;
  }

  typename Robot::Sample sample(const Readings& readings) {
    typename Robot::Sample z = Spin::sample(robot_, kinematics_, readings, yaw_rate_, heading_);
    z.imu_ok = z.encoders_ok = z.battery_ok = z.attitude_ok = true;
    z.wheel_rate_rad_s = rotor_speed_.update(z.wheel_angle_rad);
    return z;
  }

  typename Robot::Parameters robot_;
  typename Robot::Kinematics kinematics_;
  RotorSpeed<Robot::kWheels> rotor_speed_;
  Estimators estimators_;
  typename Spin::Reference reference_;
  Feedback feedback_;
  double yaw_step_;
  Command command_;
  double yaw_rate_ = 0.0;
  double heading_ = 0.0;
};

/// Of four states; what no sensor says of them is zero.
Plant plant_of(const CMatrix& A, const CMatrix& b, const Chain& chain) {
  Plant plant;
  plant.A = A;
  plant.b = b;
  plant.actuation_delay_s = chain.actuation_delay_s;
  for (SensorRow& row : plant.sensors) row.C = Eigen::RowVectorXcd::Zero(4);
  plant.sensors[kGyro].delay_s = plant.sensors[kGyroAcross].delay_s = chain.gyro_delay_s;
  plant.sensors[kAccel].delay_s = chain.accel_delay_s;
  plant.sensors[kAttitude].delay_s = chain.attitude_delay_s;
  return plant;
}

/// States: tilt z, encoder angle q, body rate w, ball rate v, each x + i y; q' = v - w, [T] (5.31).
Plant mbbr_plant(const MbbrParameters& p, double yaw_rate_rad_s, const Chain& chain) {
  enum State : int { kZ, kQ, kW, kV };
  const MbbrLinear linear = mbbr_linear(p, yaw_rate_rad_s);
  Plant plant = plant_of(linear.A, linear.b, chain);  // the ball angle gives way to the encoders'
  plant.A.col(kQ).setZero();
  plant.A.row(kQ).setZero();
  plant.A(kQ, kV) = 1.0;
  plant.A(kQ, kW) = -1.0;
  plant.drift = std::polar(1.0, -yaw_rate_rad_s * kTickS);

  MbbrHighYaw::State x = MbbrHighYaw::State::Zero();
  x(MbbrHighYaw::kThetaDotZ) = yaw_rate_rad_s;
  const Vec3 u(0.0, 0.0, -(p.k2_ball + p.mu_v) / p.k1 * yaw_rate_rad_s);
  const MbbrCoefficients c = mbbr_coefficients(p);
  Vec<5> y;
  Vec<5> driven;
  Mat<5, 7> J;
  Mat<5, 7> unused;
  MbbrHighYaw::inertial_rows(c, x, u, y, J);
  MbbrHighYaw::inertial_rows(c, x, u + Vec3::Unit(0), driven, unused);
  const auto of = [&J](int column) { return Complex(J(3, column), J(4, column)); };
  const Complex z = of(MbbrHighYaw::kThetaX);
  const Complex z_dot = of(MbbrHighYaw::kThetaDotX);

  plant.sensors[kGyro].C(kW) = 1.0;
  plant.sensors[kEncoder].C(kQ) = 1.0;
  SensorRow& accel = plant.sensors[kAccel];
  accel.C(kZ) = z - Complex(0.0, yaw_rate_rad_s) * z_dot;  // z' = w - i theta_z' z
  accel.C(kW) = z_dot;
  accel.C(kV) = of(MbbrHighYaw::kPhiDotX);
  accel.D = Complex((driven - y)(3), (driven - y)(4));
  plant.sensors[kAttitude].C(kZ) = 1.0;
  return plant;
}

/// States: theta, phi, theta', phi'.
Plant mip_plant(const MipParameters& p, double yaw_rate_rad_s, const Chain& chain) {
  const MipLinear linear = mip_linear(p, yaw_rate_rad_s);
  const MipCoefficients c = mip_coefficients(p, p.l_a.y(), p.l_a.z());
  Plant plant = plant_of(linear.A, linear.b, chain);
  plant.sensors[kGyro].C(2) = 1.0;
  plant.sensors[kGyroAcross].C(0) = yaw_rate_rad_s;  // turning, a tilted body turns about its y too
  plant.sensors[kEncoder].C(1) = 1.0;
  plant.sensors[kAccel].C(0) = c.accel_y_th + c.accel_y_th_dps2 * yaw_rate_rad_s * yaw_rate_rad_s;
  plant.sensors[kAccel].C(3) = c.accel_y_dph;
  plant.sensors[kAccel].D = c.accel_y_ux;
  plant.sensors[kAttitude].C(0) = 1.0;
  return plant;
}

constexpr double kSlow_rad_s = 0.5;  // biases of the filter are slower, and than the answers are long

constexpr double kUnlimited = 1e9;  // margins are those of the loop inside its limits

/// No limit is infinite, which is written as null.
nlohmann::json to_json(const Margins& m) {
  return {{"gain_up_dB", m.gain_up_dB},
          {"gain_down_dB", m.gain_down_dB},
          {"phase_deg", m.phase_deg},
          {"delay_ms", 1e3 * m.delay_s},
          {"disk", m.disk}};
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

/// Adds to `out`, which holds what is the robot's own, the choices and row_at(yaw rate, rad/s) for each one.
nlohmann::json with_rows(const DesignRequest& a, const Choice& choice, const std::string& sha256,
                         nlohmann::json out, const std::function<nlohmann::json(double)>& row_at) {
  out["estimator"] = choice.estimator;
  out["controller"] = choice.controller;
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

nlohmann::json mbbr_design(const DesignRequest& a, const Choice& choice, std::size_t estimator) {
  Loaded<MbbrConfig> loaded = load_mbbr(a.config, a.set);
  MbbrConfig& c = loaded.config;
  c.estimators.active = static_cast<MbbrEstimatorId>(estimator);
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
  return with_rows(a, choice, loaded.sha256, out, [&](double yaw_rate) {
    const Plant plant = mbbr_plant(c.robot, yaw_rate, c.chain);
    nlohmann::json row =
        choice.controller == "thesis"
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

nlohmann::json mip_design(const DesignRequest& a, const Choice& choice, std::size_t estimator) {
  Loaded<MipConfig> loaded = load_mip(a.config, a.set);
  MipConfig& c = loaded.config;
  c.estimators.active = static_cast<MipEstimatorId>(estimator);
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
  return with_rows(a, choice, loaded.sha256, out, [&](double yaw_rate) {
    const Plant plant = mip_plant(c.robot, yaw_rate, c.chain);
    nlohmann::json row =
        choice.controller == "lqr"
            ? judged(plant, SettledControllerOf<MipSpin, MipLqrFeedback>(c, c.lqr, yaw_rate), a.bode)
            : judged(plant, SettledControllerOf<MipSpin, MipSlcFeedback>(c, c.slc, yaw_rate), a.bode);
    const MipLinear linear = mip_linear(c.robot, yaw_rate);
    row["lqr"] = plant_json(linear.A, linear.b, K, c.design.input_delay_s);
    return row;
  });
}

}  // namespace

nlohmann::json design(const DesignRequest& request) {
  const RobotType& robot = robot_type_of(robot_type(request.config), request.config);
  Choice choice;
  choice.estimator = request.estimator;
  choice.controller = request.controller;
  complete(robot, &choice);
  const auto found = std::find(robot.estimators.begin(), robot.estimators.end(), choice.estimator);
  const auto estimator = static_cast<std::size_t>(found - robot.estimators.begin());
  const std::string type = robot.name;
  if (type == "mbbr") return mbbr_design(request, choice, estimator);
  if (type == "mip") return mip_design(request, choice, estimator);
  throw ConfigError(request.config + ": robot.type: \"" + type + "\" has no design; allowed: mbbr, mip");
}

}  // namespace equipoise::app
