#include <map>

#include "app/verify/rows.hpp"
#include "robots/mbbr/dynamics.hpp"
#include "robots/mip/dynamics.hpp"

namespace equipoise::app {
namespace {

nlohmann::json evaluate_mbbr(const MbbrDynamics& dynamics, const nlohmann::json& row) {
  const Vec2 theta_xy = numbers_at(row, "theta_xy", 2);
  const Vec3 theta_dot = numbers_at(row, "theta_dot", 3);
  const Vec3 tau_B = numbers_at(row, "tau_B", 3);
  const MbbrMotion m(theta_xy, body_rates(theta_xy, theta_dot), numbers_at(row, "phi_star_dot", 2));
  const MbbrAccelerations a = dynamics.accelerations(m, tau_B);
  Vec<5> qdd;
  qdd << MbbrDynamics::theta_ddot(m, a), MbbrDynamics::phi_star_ddot(m, a);
  return {{"theta_xy", array_of(theta_xy)},
          {"theta_dot", array_of(theta_dot)},
          {"phi_star_dot", array_of(m.phi_dot_star)},
          {"tau_B", array_of(tau_B)},
          {"qdd", array_of(qdd)},
          {"gyro_B", array_of(m.omega_B)},
          {"encoder_rate_B", array_of(MbbrDynamics::encoder_rate_B(m))},
          {"accel_B", array_of(dynamics.accelerometer_B(m, a))}};
}

nlohmann::json evaluate_mip(const nlohmann::json& row) {
  const MipDynamics dynamics(MipParameters{}, flag_at(row, "side_force"));
  MipMotion m;
  m.theta = number_at(row, "theta");
  m.theta_dot = number_at(row, "theta_dot");
  m.phi_dot = number_at(row, "phi_dot");
  m.psi_dot = number_at(row, "psi_dot");
  const double u_x = number_at(row, "u_x");
  const double u_z = number_at(row, "u_z");
  const Vec3 qdd = dynamics.accelerations_from_inputs(m, u_x, u_z);
  return {{"theta", m.theta},     {"theta_dot", m.theta_dot},
          {"phi_dot", m.phi_dot}, {"psi_dot", m.psi_dot},
          {"u_x", u_x},           {"u_z", u_z},
          {"qdd", array_of(qdd)}, {"accel_B", array_of(dynamics.accelerometer_B(m, qdd))}};
}

/// By the robot's name.
const std::map<std::string, Row>& models() {
  static const std::map<std::string, Row> all{
      {"mbbr", [dynamics = MbbrDynamics{MbbrParameters{}}](
                   const nlohmann::json& row) { return evaluate_mbbr(dynamics, row); }},
      {"mip", evaluate_mip}};
  return all;
}

}  // namespace

void add_model(Subcommand app) {
  const Subcommand command =
      app.subcommand("model", "Evaluates the exact plant, published parameters, on rows of JSON")
          .example("equipoise model --robot mbbr --in rows.json --json -");
  auto robot = std::make_shared<std::string>();
  command.option("--robot", *robot, "mbbr or mip").required().one_of({"mbbr", "mip"});
  add_rows(
      command,
      "rows: mbbr {theta_xy, theta_dot, phi_star_dot, tau_B}, "
      "mip {theta, theta_dot, phi_dot, psi_dot, u_x, u_z; side_force: true, of rolling, which [T] loses}",
      [=] { return models().at(*robot); });
}

}  // namespace equipoise::app
