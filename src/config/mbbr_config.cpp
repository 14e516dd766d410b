#include <algorithm>

#include "disturbance_config.hpp"
#include "equipoise/config.hpp"
#include "toml_reader.hpp"

namespace equipoise {
namespace {

using config::Document;
using config::Section;

constexpr double kTwoPi = 2.0 * kPi;

const std::vector<std::string> kBridgeNames{"drive_brake", "drive_coast"};

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
  s.finish();
  return p;
}

MotorParameters read_motor(Section s) {
  MotorParameters m;
  m.resistance_ohm = s.number("resistance_ohm", 0.01, 1000.0);
  m.torque_constant_N_m_A = s.number("torque_constant_N_m_A", 1e-5, 100.0);
  m.inductance_H = s.number("inductance_H", 1e-7, 1.0);
  m.pwm_hz = s.number("pwm_hz", 100.0, 100e3);
  m.nominal_V = s.number("nominal_V", 1.0, 60.0);
  m.bridge = s.choice("bridge", kBridgeNames) == 0 ? BridgeType::kDriveBrake : BridgeType::kDriveCoast;
  s.finish();
  return m;
}

Calibration read_calibration(Section s) {
  Calibration c;
  c.gyro_rad_s_per_count = kPi / 180.0 / s.number("gyro_counts_per_deg_s", 1.0, 200.0);
  c.accel_m_s2_per_count = kGravity_m_s2 / s.number("accel_counts_per_g", 500.0, 20000.0);
  c.battery_V_per_count = s.number("battery_V_per_count", 1e-6, 1.0);
  c.battery_offset_V = s.number("battery_offset_V", -5.0, 5.0);
  c.encoder_counts_per_rev = s.number("encoder_counts_per_rev", 1.0, 1e6);
  const auto sign = [&s](const std::string& key) {
    std::array<double, kMaxMotors> signs{1, 1, 1, 1};
    const std::vector<double> values = s.numbers(key, Mbbr::kWheels, -1.0, 1.0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (std::abs(values[i]) != 1.0) s.fail(key, "allowed: 1 or -1");
      signs[i] = values[i];
    }
    return signs;
  };
  c.encoder_sign = sign("encoder_sign");
  c.motor_sign = sign("motor_sign");
  const std::vector<double> mount = s.numbers("R_BS", 9, -1.0, 1.0);
  c.R_BS = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(mount.data());
  if ((c.R_BS * c.R_BS.transpose() - Mat3::Identity()).norm() > 1e-6 || c.R_BS.determinant() < 0.0) {
    s.fail("R_BS", "is not a rotation matrix (rows, sensor axes to body axes)");
  }
  c.gyro_bias_B_rad_s = s.vector<3>("gyro_bias_rad_s", -1.0, 1.0);
  c.accel_bias_B_m_s2 = s.vector<3>("accel_bias_m_s2", -2.0, 2.0);
  s.finish();
  return c;
}

template <class Filter, int N, int M>
void read_filter(Section s, Filter& params) {
  params.Q = s.vector<N>("q", 0.0, 1e6);
  params.R = s.vector<M>("r", 1e-15, 1e6);
  params.input_variance = s.vector<3>("input_variance", 0.0, 100.0);
  params.initial_variance = s.number("initial_variance", 0.0, 1e3);
  s.finish();
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

MbbrReferenceParams read_reference(Section s, double ball_radius_m) {
  MbbrReferenceParams p;
  p.slc_unit = s.number("slc_unit_rad_per_rad_s", 0.0, 1.0);
  p.slc_sign = s.number("slc_sign", -1.0, 1.0);
  p.rate_feedback =
      s.choice("rate_feedback", {"body", "euler"}) == 0 ? RateFeedback::kBody : RateFeedback::kEuler;
  p.frame = s.choice("filter_frame", {"inertial", "yaw"}) == 0 ? FilterFrame::kInertial : FilterFrame::kYaw;
  p.max_acceleration_m_s2 = s.number("max_acceleration_m_s2", 0.01, 100.0);
  p.max_yaw_acceleration_rad_s2 = s.number("max_yaw_acceleration_rad_s2", 0.01, 1000.0);
  p.ball_radius_m = ball_radius_m;
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

SafetyParams read_safety(Section s) {
  SafetyParams p;
  p.max_tilt_rad = s.number("max_tilt_rad", 0.05, 1.5);
  p.max_arm_tilt_rad = s.number("max_arm_tilt_rad", 0.01, 1.0);
  p.max_arm_rate_rad_s = s.number("max_arm_rate_rad_s", 0.01, 100.0);
  p.max_missed_samples = s.integer("max_missed_samples", 0, 20);
  p.max_attitude_age_ticks = s.integer("max_attitude_age_ticks", 1, 200);
  p.min_battery_V = s.number("min_battery_V", 0.0, 60.0);
  s.finish();
  return p;
}

WorldParams read_world(Section s, BridgeType* bridge) {
  WorldParams w;
  *bridge = s.choice("bridge", kBridgeNames) == 0 ? BridgeType::kDriveBrake : BridgeType::kDriveCoast;
  w.step_s = s.number("step_s", 1e-5, kTickS);
  const double steps = kTickS / w.step_s;
  if (std::abs(steps - std::round(steps)) > 1e-9) s.fail("step_s", "must divide the tick of 0.005 s");
  w.initial_tilt_rad = s.number("initial_tilt_rad", 0.0, 0.3);
  w.friction = s.boolean("friction");
  w.process_noise_sigma = s.vector<10>("process_noise_variance", 0.0, 10.0).cwiseSqrt();
  w.gyro_sigma_rad_s = s.number("gyro_sigma_rad_s", 0.0, 1.0);
  w.accel_sigma_m_s2 = s.number("accel_sigma_m_s2", 0.0, 20.0);
  w.gyro_bias_sigma_rad_s = s.number("gyro_bias_sigma_rad_s", 0.0, 1.0);
  w.accel_bias_sigma_m_s2 = s.number("accel_bias_sigma_m_s2", 0.0, 5.0);
  w.encoder_sigma_rad = s.number("encoder_sigma_rad", 0.0, 1.0);
  w.quantise = s.boolean("quantise");
  w.battery_V = s.number("battery_V", 1.0, 60.0);
  w.battery_resistance_ohm = s.number("battery_resistance_ohm", 0.0, 5.0);
  w.attitude_sigma_rad = s.number("attitude_sigma_rad", 0.0, 0.5);
  w.attitude_time_constant_s = s.number("attitude_time_constant_s", 0.01, 1000.0);
  w.attitude_heading_drift_rad_sqrt_s = s.number("attitude_heading_drift_rad_sqrt_s", 0.0, 1.0);
  w.attitude_latency_ticks = s.integer("attitude_latency_ticks", 0, 15);
  for (Section& row : s.tables("pushes", 0, 100)) {
    Push push;
    push.at_s = row.number("at_s", 0.0, 1e6);
    push.duration_s = row.number("duration_s", 1e-3, 10.0);
    push.force_W_N = row.vector<2>("force_N", -100.0, 100.0);
    row.finish();
    w.pushes.push_back(push);
  }
  w.disturbed = s.has("disturbance");
  if (w.disturbed) w.disturbance = config::read_disturbance(s.table("disturbance"));
  s.finish();
  return w;
}

LoadedMbbr read_mbbr(const Document& document) {
  Section root(document, document.root(), "");
  LoadedMbbr loaded;
  MbbrConfig& c = loaded.config;

  Section robot = root.table("robot");
  if (robot.text("type") != "mbbr")
    robot.fail("type", "\"" + robot.text("type") + "\" is not this robot; expected mbbr");
  c.robot = read_robot(robot);
  c.motor = read_motor(root.table("motor"));
  c.calibration = read_calibration(root.table("calibration"));
  Section friction = root.table("friction");
  c.friction.coulomb_u = c.robot.mu_c / c.robot.k1;
  c.friction.gain = friction.number("compensation", 0.0, 1.5);
  friction.finish();

  Section estimator = root.table("estimator");
  read_filter<KalmanFilter<MbbrModel10>::Params, 10, 8>(estimator.table("ekf"), c.estimators.ekf);
  read_filter<KalmanFilter<MbbrModel13>::Params, 13, 8>(estimator.table("ekf13"), c.estimators.ekf13);
  read_filter<KalmanFilter<MbbrPublishedModel>::Params, 13, 8>(estimator.table("ekf13_published"),
                                                               c.estimators.ekf13_published);
  Section kf = estimator.table("kf_attitude");
  c.estimators.kf_yaw_transport = kf.boolean("yaw_transport");
  read_filter<KalmanFilter<MbbrLinearModel>::Params, 8, 6>(kf, c.estimators.kf);
  estimator.finish();
  c.estimators.robot = c.robot;

  c.reference = read_reference(root.table("reference"), c.robot.r);
  Section controller = root.table("controller");
  c.thesis = read_thesis(controller.table("thesis"));
  Section scheduled = controller.table("scheduled");
  c.scheduled.yaw_feedforward = scheduled.boolean("yaw_feedforward");
  scheduled.finish();
  controller.finish();
  c.safety = read_safety(root.table("safety"));

  Section world = root.table("world");
  for (std::size_t i = 0; i < kFidelityNames.size(); ++i) {
    c.world[i] = read_world(world.table(kFidelityNames[i]), &c.world_bridge[i]);
  }
  world.finish();
  root.finish();
  loaded.sha256 = document.sha256();
  loaded.toml = document.canonical();
  return loaded;
}

}  // namespace

std::string robot_type(const std::string& path) {
  const Document document(path, {});
  Section root(document, document.root(), "");
  return root.table("robot").text("type");
}

LoadedMbbr load_mbbr(const std::string& path, const std::vector<std::string>& overrides) {
  return read_mbbr(Document(path, overrides));
}

LoadedMbbr parse_mbbr(const std::string& text, const std::string& origin) {
  return read_mbbr(Document::parse(text, origin));
}

MbbrThesisPipeline::Params MbbrConfig::thesis_pipeline() const {
  return {robot, calibration, estimators, reference, thesis, friction, motor, safety};
}

MbbrScheduledPipeline::Params MbbrConfig::scheduled_pipeline() const {
  return {robot, calibration, estimators, reference, scheduled, friction, motor, safety};
}

}  // namespace equipoise
