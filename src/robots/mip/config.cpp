#include "robots/mip/config.hpp"

#include "config/common_config.hpp"

namespace equipoise {
namespace {

using config::Document;
using config::read_filter;
using config::Section;

MipParameters read_robot(Section s) {
  MipParameters p;
  p.m_b = s.number("body_mass_kg", 0.01, 20.0);
  p.m_w = s.number("wheel_mass_kg", 0.001, 10.0);
  p.r = s.number("wheel_radius_m", 0.005, 0.5);
  p.d = s.number("track_m", 0.01, 2.0);
  p.l = s.number("com_height_m", 0.005, 2.0);
  const Vec3 body = s.vector<3>("body_inertia_kg_m2", 1e-7, 10.0);
  p.I_b1 = body.x();
  p.I_b2 = body.y();
  p.I_b3 = body.z();
  const Vec3 wheel = s.vector<3>("wheel_inertia_kg_m2", 1e-8, 1.0);
  p.I_w1 = wheel.x();
  p.I_w2 = wheel.y();
  p.I_w3 = wheel.z();
  p.I_r = config::number_or(s, "rotor_inertia_kg_m2", 0.0, 0.0, 1.0);
  p.k1 = s.number("k1_N_m", 1e-4, 100.0);
  p.k2 = s.number("k2_N_m_s", 0.0, 10.0);
  p.mu_c = s.number("coulomb_friction_N_m", 0.0, 10.0);
  p.mu_v = s.number("viscous_friction_N_m_s", 0.0, 10.0);
  p.l_a = s.vector<3>("imu_position_m", -1.0, 1.0);
  s.finish();
  return p;
}

MipEkf::Params read_ekf(Section s) {
  constexpr int n = MipEkfModel::kStates;
  MipEkf::Params p;
  p.options.estimate_gyro_bias = s.boolean("estimate_gyro_bias");
  p.options.estimate_mount = s.boolean("estimate_mount");
  p.options.know_lever_arm = s.boolean("know_lever_arm");
  p.options.estimate_lever_arm = s.boolean("estimate_lever_arm");
  p.filter.Q = s.vector<n>("q", 0.0, 1e6);
  p.filter.R = s.vector<MipEkfModel::kOutputs>("r", 1e-15, 1e6);
  p.filter.input_variance = s.vector<2>("input_variance", 0.0, 100.0);
  p.filter.initial_variance = s.vector<n>("initial_sigma", 0.0, 30.0).cwiseAbs2();
  p.disturbance_time_constant_s = s.number("disturbance_time_constant_s", kTickS, 1e6);
  p.precision = config::read_precision(s);
  s.finish();
  return p;
}

MipEstimatorParams read_estimators(Section s, const MipParameters& robot) {
  MipEstimatorParams p;
  p.robot = robot;
  p.heading_time_constant_s = s.number("heading_time_constant_s", kTickS, 1000.0);
  Section complementary = s.table("complementary");
  p.complementary_weight = complementary.number("weight", 0.0, 1.0);
  complementary.finish();
  read_filter<KalmanFilter<MipInclinometerModel>>(s.table("complementary_kf"), p.complementary_kf);
  read_filter<KalmanFilter<MipPlanarModel>>(s.table("planar_kf"), p.planar_kf);
  p.ekf = read_ekf(s.table("ekf"));
  read_filter<KalmanFilter<MipPublishedModel>>(s.table("ekf_published"), p.ekf_published);
  s.finish();
  return p;
}

MipReferenceParams read_reference(Section s, const MipParameters& robot, double friction_share) {
  MipReferenceParams p;
  p.max_acceleration_m_s2 = s.number("max_acceleration_m_s2", 0.01, 100.0);
  p.max_jerk_m_s3 = std::min(s.number("max_jerk_m_s3", 0.01, 1e9), feasible_jerk_m_s3(robot));
  p.max_yaw_acceleration_rad_s2 = s.number("max_yaw_acceleration_rad_s2", 0.01, 1000.0);
  const MipWheelBudget wheel{s.number("duty_share", 0.05, 1.0),
                             s.number("max_wheel_rate_rad_s", 0.1, 1000.0)};
  p.max_phi_error_rad = s.number("max_phi_error_rad", 0.01, 1000.0);
  p.wheel_radius_m = robot.r;
  p.feasible_acceleration_m_s2 = feasible_acceleration_m_s2(robot);
  p.budget = mip_duty_budget(robot, wheel, friction_share);
  s.finish();
  return p;
}

/// What both controllers limit.
template <class Params>
void read_limits(Section& s, Params& p) {
  p.max_lean_rad = s.number("max_lean_rad", 0.01, 1.0);
  p.max_u = s.number("max_u", 0.1, 10.0);
  p.soft_start_s = s.number("soft_start_s", 0.0, 5.0);
}

constexpr double kMinWeight = 1e-6;
constexpr double kMaxWeight = 1e6;

MipSlcDesign read_slc_design(Section s) {
  MipSlcDesign d;
  d.gain_U = s.number("gain_U", kMinWeight, kMaxWeight);
  d.integral_p = s.number("integral_p", kMinWeight, kMaxWeight);
  d.lead_q = s.number("lead_q", kMinWeight, kMaxWeight);
  d.roll_off_rad_s = s.number("roll_off_rad_s", 1.0, kMaxWeight);
  d.outer_gain_pp_a = s.number("outer_gain_pp_a", kMinWeight, kMaxWeight);
  d.outer_zero_p = s.number("outer_zero_p", kMinWeight, kMaxWeight);
  d.outer_pole_p = s.number("outer_pole_p", kMinWeight, kMaxWeight);
  d.outer_roll_off_rad_s = s.number("outer_roll_off_rad_s", 1.0, kMaxWeight);
  s.finish();
  return d;
}

MipLqrDesign read_lqr_design(Section s, double* input_delay_s) {
  MipLqrDesign d;
  d.theta_rad = s.number("theta_rad", kMinWeight, kMaxWeight);
  d.phi_rad = s.number("phi_rad", kMinWeight, kMaxWeight);
  d.theta_dot_rad_s = s.number("theta_dot_rad_s", kMinWeight, kMaxWeight);
  d.phi_dot_rad_s = s.number("phi_dot_rad_s", kMinWeight, kMaxWeight);
  d.u_x = s.number("u_x", kMinWeight, kMaxWeight);
  *input_delay_s = s.number("input_delay_s", 0.0, kTickS);
  s.finish();
  return d;
}

MipYawDesign read_yaw_design(Section s) {
  MipYawDesign d;
  d.psi_rad = s.number("psi_rad", kMinWeight, kMaxWeight);
  d.psi_dot_rad_s = s.number("psi_dot_rad_s", kMinWeight, kMaxWeight);
  d.u_z = s.number("u_z", kMinWeight, kMaxWeight);
  s.finish();
  return d;
}

MipWorldParams read_mip_world(Section s, BridgeType* bridge) {
  MipWorldParams w;
  w.process_noise_sigma = s.vector<6>("process_noise_variance", 0.0, 10.0).cwiseSqrt();
  w.drivetrain.motor_gain = s.vector<2>("motor_gain", 0.1, 10.0);
  w.drivetrain.friction_gain = s.vector<2>("friction_gain", 0.0, 10.0);
  w.drivetrain.gear.play_rad = s.number("backlash_rad", 0.0, 0.5);
  w.drivetrain.gear.rotor_inertia_kg_m2 = s.number("rotor_inertia_kg_m2", 1e-7, 1.0);
  w.lift_at_s = s.number("lift_at_s", -1.0, 1e6);
  w.common = config::read_world(s, bridge);
  return w;
}

Loaded<MipConfig> read_mip(const Document& document) {
  Section root(document, document.root(), "");
  MipConfig c;
  Section robot = root.table("robot");
  config::expect_robot(robot, "mip");
  c.robot = read_robot(robot);
  c.friction.coulomb_u = c.robot.mu_c / c.robot.k1;
  config::read_machine(root, Mip::kWheels, &c);
  c.estimators = read_estimators(root.table("estimator"), c.robot);
  const Section reference = root.table("reference");
  c.reference = read_reference(reference, c.robot, c.friction.gain);

  Section controller = root.table("controller");
  Section slc = controller.table("slc");
  c.slc.published = slc.boolean("published");
  read_limits(slc, c.slc);
  c.design.slc = read_slc_design(slc.table("design"));
  slc.finish();
  Section lqr = controller.table("lqr");
  read_limits(lqr, c.lqr);
  c.design.lqr = read_lqr_design(lqr.table("design"), &c.design.input_delay_s);
  lqr.finish();
  c.design.yaw = read_yaw_design(controller.table("yaw"));
  if (const auto problem = design_problem(c.robot, c.design, c.motor.k1()))
    config::refuse(*problem, lqr, robot);
  config::require_room(reference, c.reference.budget);
  c.slc.gains = c.lqr.gains = design_mip(c.robot, c.design);
  controller.finish();
  config::read_surroundings(
      root, c.robot.l_a,
      [&c](Section world, std::size_t level) {
        c.world[level] = read_mip_world(std::move(world), &c.world_bridge[level]);
      },
      &c);
  c.estimators.ekf.sensor_age_s = c.chain.gyro_delay_s;
  c.estimators.gyro_axis_sign = axis_sign(c.calibration.R_BS);
  return {config::loaded(document), c};
}

}  // namespace

Loaded<MipConfig> load_mip(const std::string& path, const Overrides& overrides) {
  return read_mip(Document(path, overrides));
}

Loaded<MipConfig> parse_mip(const std::string& text, const std::string& origin,
                            const std::vector<std::string>& set) {
  return read_mip(Document::parse(text, origin, set));
}

MipSlcPipeline::Params MipConfig::slc_pipeline() const {
  if (const auto problem = slc.published ? std::nullopt : slc_problem(robot, design, slc.gains.slc))
    throw ConfigError("controller.slc.design: " + problem->why +
                      "; change it (equipoise design shows its margins) or choose --controller lqr");
  return {robot, calibration, estimators, reference, slc, friction, motor, safety, attitude};
}

MipLqrPipeline::Params MipConfig::lqr_pipeline() const {
  return {robot, calibration, estimators, reference, lqr, friction, motor, safety, attitude};
}

}  // namespace equipoise
