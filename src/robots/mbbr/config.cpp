#include "robots/mbbr/config.hpp"

#include <algorithm>
#include <limits>

#include "config/common_config.hpp"

namespace equipoise {
namespace {

using config::Document;
using config::read_filter;
using config::Section;

constexpr double kTwoPi = 2.0 * kPi;

MbbrParameters read_robot(Section s) {
  MbbrParameters p;
  s.text("type");
  p.m_t = s.number("body_mass_kg", 0.01, 20.0);
  p.m_b = s.number("ball_mass_kg", 0.001, 10.0);
  p.r = s.number("ball_radius_m", 0.005, 0.5);
  p.r_w = s.number("wheel_radius_m", 0.002, 0.2);
  p.l = s.number("com_height_m", 0.005, 2.0);
  const Vec3 inertia = s.vector<3>("body_inertia_kg_m2", 1e-7, 10.0);
  p.I_t1 = inertia.x();
  p.I_t2 = inertia.y();
  p.I_t3 = inertia.z();
  p.I_b = s.number("ball_inertia_kg_m2", 1e-8, 1.0);
  p.I_w = s.number("wheel_inertia_about_ball_kg_m2", 0.0, 1.0);
  p.k1 = s.number("k1_N_m", 1e-4, 100.0);
  p.k2_ball = s.number("k2_ball_N_m_s", 0.0, 10.0);
  p.mu_c = s.number("coulomb_friction_N_m", 0.0, 10.0);
  p.mu_v = s.number("viscous_friction_N_m_s", 0.0, 10.0);
  p.l_a = s.vector<3>("imu_position_m", -1.0, 1.0);
  p.alpha_deg = s.number("wheel_latitude_deg", 35.3, 89.0);
  p.azimuth_deg = s.number("wheel_azimuth_deg", -180.0, 180.0);
  if (s.is_text("wheel_tilt_deg")) {
    s.choice("wheel_tilt_deg", {"orthogonal"});
  } else if (s.has("wheel_tilt_deg")) {
    p.wheel_tilt_deg = s.number("wheel_tilt_deg", -90.0, 90.0);
    constexpr double kLeast = 0.05;  // volume of the axes; 1: orthogonal
    if (std::abs(p.wheel_axes().determinant()) < kLeast)
      s.fail("wheel_tilt_deg", "with these axes the wheels cannot turn the ball about every axis");
  }
  s.finish();
  return p;
}

/// Rows over yaw rate, given in Hz, strictly ascending from zero.
template <std::size_t Columns>
GainSchedule<Columns> read_schedule(Section& parent, const std::string& key,
                                    const std::array<const char*, Columns>& names) {
  GainSchedule<Columns> schedule;
  double previous = -1.0;
  for (Section& row : parent.tables(key, 1, 16)) {
    const double hz = row.number("yaw_hz", 0.0, 20.0);
    if (hz <= previous) row.fail("yaw_hz", "rows must ascend");
    previous = hz;
    schedule.at[schedule.rows] = hz * kTwoPi;
    for (std::size_t c = 0; c < Columns; ++c)
      schedule.row[schedule.rows][c] = row.number(names[c], -1e3, 1e3);
    row.finish();
    ++schedule.rows;
  }
  return schedule;
}

MbbrReferenceParams read_reference(Section s, const MbbrParameters& robot, double friction_share) {
  MbbrReferenceParams p;
  p.slc_unit = s.number("slc_unit_rad_per_rad_s", 0.0, 1.0);
  p.slc_sign = s.number("slc_sign", -1.0, 1.0);
  p.rate_feedback =
      s.choice("rate_feedback", {"body", "euler"}) == 0 ? RateFeedback::kBody : RateFeedback::kEuler;
  p.frame = s.choice("filter_frame", {"inertial", "yaw"}) == 0 ? FilterFrame::kInertial : FilterFrame::kYaw;
  p.max_acceleration_m_s2 = s.number("max_acceleration_m_s2", 0.01, 100.0);
  p.feasible_acceleration_m_s2 = feasible_acceleration_m_s2(robot);
  p.max_jerk_m_s3 = std::min(s.number("max_jerk_m_s3", 0.01, 1e9), feasible_jerk_m_s3(robot));
  p.max_yaw_acceleration_rad_s2 = s.number("max_yaw_acceleration_rad_s2", 0.01, 1000.0);
  p.floor_yaw_acceleration_rad_s2 = s.number("floor_yaw_acceleration_rad_s2", 0.01, 1000.0);
  p.budget = mbbr_duty_budget(robot, s.number("duty_share", 0.05, 1.0), friction_share);
  p.ball_radius_m = robot.r;
  p.schedule =
      read_schedule<MbbrReferenceParams::kColumns>(s, "schedule", {"slc_gain", "slc_pole", "low_pass_rad_s"});
  s.finish();
  return p;
}

MbbrThesisFeedbackParams read_thesis(Section s) {
  MbbrThesisFeedbackParams p;
  p.yaw_feedforward_s = s.number("yaw_feedforward_s", -1.0, 1.0);
  p.schedule =
      read_schedule<MbbrThesisFeedbackParams::kColumns>(s, "gains", {"c1", "c2", "c3", "c4", "c5", "c6"});
  s.finish();
  return p;
}

MbbrEkf::Params read_ekf(Section s) {
  constexpr int n = MbbrEkfModel::kStates;
  MbbrEkf::Params p;
  p.filter.Q = s.vector<n>("q", 0.0, 1e6);
  p.filter.R = s.vector<MbbrEkfModel::kOutputs>("r", 1e-15, 1e6);
  p.filter.input_variance = s.vector<3>("input_variance", 0.0, 100.0);
  p.filter.initial_variance = s.vector<n>("initial_sigma", 0.0, 30.0).cwiseAbs2();
  p.disturbance_time_constant_s = s.number("disturbance_time_constant_s", kTickS, 1e6);
  p.precision = config::read_precision(s);
  p.push_nis = s.number("push_nis", 1.0, 1e9);
  s.finish();
  return p;
}

MbbrDesignParams read_design(Section s) {
  constexpr double kMin = 1e-6;
  constexpr double kMax = 1e6;
  MbbrDesignParams d;
  d.theta_rad = s.number("theta_rad", kMin, kMax);
  d.phi_rad = s.number("phi_rad", kMin, kMax);
  d.body_rate_rad_s = s.number("body_rate_rad_s", kMin, kMax);
  d.phi_dot_rad_s = s.number("phi_dot_rad_s", kMin, kMax);
  d.u = s.number("u", kMin, kMax);
  d.theta_z_rad = s.number("theta_z_rad", kMin, kMax);
  d.theta_z_dot_rad_s = s.number("theta_z_dot_rad_s", kMin, kMax);
  d.u_z = s.number("u_z", kMin, kMax);
  d.input_delay_s = s.number("input_delay_s", 0.0, kTickS);
  d.step_hz = s.number("step_hz", 0.01, 10.0);
  d.last_hz = s.number("last_hz", 0.0, 20.0);
  const double rows = d.last_hz / d.step_hz + 1.0;
  if (rows > static_cast<double>(MbbrGains{}.schedule.at.size())) {
    s.fail("step_hz", "last_hz / step_hz + 1 rows are too many; allowed: 16");
  }
  s.finish();
  return d;
}

void read_disturbance(Section& s, MbbrWorldParams* w) {
  w->coulomb_scale = s.number("coulomb_scale", 0.0, 10.0);
  w->extra_viscous_N_m_s = s.number("extra_viscous_N_m_s", 0.0, 1.0);
  w->yaw_friction_scale = s.vector<2>("yaw_friction_scale", 0.0, 10.0);
  w->drive.wheel_torque_scale = s.vector<3>("wheel_torque_scale", 0.0, 2.0);
  w->drive.gear.play_rad = s.number("backlash_rad", 0.0, 0.5);
  w->drive.gear.rotor_inertia_kg_m2 = s.number("rotor_inertia_kg_m2", 1e-8, 1.0);
  w->drive.roller_tilt_rad = s.number("roller_tilt_rad", 0.0, 0.5);
  w->drive.rollers_per_turn = s.number("rollers_per_turn", 1.0, 100.0);
  w->drive.roller_slip_N_m = s.number("roller_slip_N_m", 0.0, 1.0);
  w->drive.wheel_grip = s.number("wheel_grip", 0.0, 5.0);
  w->drive.gearbox_friction_share = config::number_or(s, "gearbox_friction_share", 0.0, 0.0, 1.0);
  w->floor.grip = config::number_or(s, "floor_grip", 0.0, 0.0, 5.0);
  w->floor.torsion_radius_m = config::number_or(s, "floor_torsion_radius_m", 0.004, 0.0, 0.1);
}

MbbrWorldParams read_mbbr_world(Section s, BridgeType* bridge) {
  MbbrWorldParams w;
  w.process_noise_sigma = s.vector<10>("process_noise_variance", 0.0, 10.0).cwiseSqrt();
  w.common = config::read_world(s, bridge, {true, [&w](Section& d) { read_disturbance(d, &w); }});
  return w;
}

Loaded<MbbrConfig> read_mbbr(const Document& document) {
  Section root(document, document.root(), "");
  MbbrConfig c;
  Section robot = root.table("robot");
  config::expect_robot(robot, "mbbr");
  c.robot = read_robot(robot);
  c.friction.coulomb_u = c.robot.mu_c / c.robot.k1;
  config::read_machine(root, Mbbr::kWheels, &c);

  Section estimator = root.table("estimator");
  c.estimators.ekf = read_ekf(estimator.table("ekf"));
  read_filter<KalmanFilter<MbbrModel13>>(estimator.table("ekf13"), c.estimators.ekf13);
  read_filter<KalmanFilter<MbbrPublishedModel>>(estimator.table("ekf13_published"),
                                                c.estimators.ekf13_published);
  Section kf = estimator.table("kf_attitude");
  c.estimators.kf_published = kf.choice("model", {"derived", "published"}) == 1;
  c.estimators.kf_yaw_transport = kf.boolean("yaw_transport");
  read_filter<KalmanFilter<MbbrLinearModel>>(kf, c.estimators.kf);
  estimator.finish();
  c.estimators.robot = c.robot;

  const Section reference = root.table("reference");
  c.reference = read_reference(reference, c.robot, c.friction.gain);
  Section controller = root.table("controller");
  c.thesis = read_thesis(controller.table("thesis"));
  Section scheduled = controller.table("scheduled");
  c.scheduled.yaw_feedforward = scheduled.boolean("yaw_feedforward");
  c.design = read_design(scheduled.table("design"));
  if (const auto problem = design_problem(c.robot, c.design, c.motor.k1()))
    config::refuse(*problem, scheduled, robot);
  config::require_room(reference, c.reference.budget);
  c.scheduled.gains = design_mbbr(c.robot, c.design);
  scheduled.finish();
  controller.finish();
  config::read_surroundings(
      root, c.robot.l_a,
      [&c](Section world, std::size_t level) {
        c.world[level] = read_mbbr_world(std::move(world), &c.world_bridge[level]);
      },
      &c);
  c.estimators.ekf.sensor_age_s = c.chain.gyro_delay_s;
  c.estimators.gyro_axis_sign = axis_sign(c.calibration.R_BS);
  return {config::loaded(document), c};
}

}  // namespace

Loaded<MbbrConfig> load_mbbr(const std::string& path, const Overrides& overrides) {
  return read_mbbr(Document(path, overrides));
}

Loaded<MbbrConfig> parse_mbbr(const std::string& text, const std::string& origin,
                              const std::vector<std::string>& set) {
  return read_mbbr(Document::parse(text, origin, set));
}

MbbrThesisPipeline::Params MbbrConfig::thesis_pipeline() const {
  MbbrReferenceParams as_published = reference;  // [T] 6.2.1 limits no command; the configured limits stay
  as_published.max_jerk_m_s3 = std::numeric_limits<double>::infinity();
  as_published.floor_yaw_acceleration_rad_s2 = std::numeric_limits<double>::infinity();
  as_published.budget = DutyBudget{};
  as_published.feasible_acceleration_m_s2 = std::numeric_limits<double>::infinity();
  return {robot, calibration, estimators, as_published, thesis, friction, motor, safety, attitude};
}

MbbrScheduledPipeline::Params MbbrConfig::scheduled_pipeline() const {
  return {robot, calibration, estimators, reference, scheduled, friction, motor, safety, attitude};
}

}  // namespace equipoise
