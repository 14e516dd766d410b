#include "config/common_config.hpp"

#include <algorithm>

#include "config/population.hpp"

namespace equipoise {

std::string robot_type(const std::string& path) {
  const config::Document document(path, {});
  config::Section root(document, document.root(), "");
  return root.table("robot").text("type");
}

namespace config {
namespace {

const std::vector<std::string> kBridgeNames{"drive_brake", "drive_coast"};

/// The name under which a file has this world; logs of earlier builds call the nominal one full.
std::string world_key(const Section& worlds, const std::string& fidelity) {
  const bool optional = fidelity == "nominal" || fidelity == "built2025";
  return optional && !worlds.has(fidelity) ? "full" : fidelity;
}

}  // namespace

void expect_robot(Section& robot, const std::string& type) {
  const std::string found = robot.text("type");
  if (found != type) robot.fail("type", "\"" + found + "\" is not this robot; expected " + type);
}

void require_room(const Section& reference, const DutyBudget& budget) {
  if (budget.share > budget.of_friction) return;
  reference.fail("duty_share", "is " + std::to_string(budget.share) +
                                   ", all of which compensated friction takes (" +
                                   std::to_string(budget.of_friction) +
                                   "): no command would move the robot; raise it, or lower "
                                   "friction.compensation");
}

MotorParameters read_motor(Section s) {
  MotorParameters m;
  m.resistance_ohm = s.number("resistance_ohm", 0.01, 1000.0);
  m.torque_constant_N_m_A = s.number("torque_constant_N_m_A", 1e-5, 100.0);
  m.inductance_H = s.number("inductance_H", 1e-7, 1.0);
  m.pwm_hz = s.number("pwm_hz", 100.0, 100e3);
  m.nominal_V = s.number("nominal_V", 1.0, 60.0);
  m.bridge = s.choice("bridge", kBridgeNames) == 0 ? BridgeType::kDriveBrake : BridgeType::kDriveCoast;
  if (s.has("bridge_lost_s")) m.bridge_lost_s = s.number("bridge_lost_s", 0.0, 1e-4);  // older logs: 0
  if (s.has("invert_bridge")) m.invert_bridge = s.boolean("invert_bridge");            // logs before it: true
  s.finish();
  return m;
}

Calibration read_calibration(Section s, int wheels) {
  Calibration c;
  c.gyro_rad_s_per_count = kPi / 180.0 / s.number("gyro_counts_per_deg_s", 1.0, 200.0);
  c.accel_m_s2_per_count = kGravity_m_s2 / s.number("accel_counts_per_g", 500.0, 20000.0);
  c.battery_V_per_count = s.number("battery_V_per_count", 1e-6, 1.0);
  c.battery_offset_V = s.number("battery_offset_V", -5.0, 5.0);
  c.encoder_counts_per_rev = s.number("encoder_counts_per_rev", 1.0, 1e6);
  const auto sign = [&s, wheels](const std::string& key) {
    std::array<double, kMaxMotors> signs{1, 1, 1, 1};
    const std::vector<double> values = s.numbers(key, static_cast<std::size_t>(wheels), -1.0, 1.0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (std::abs(values[i]) != 1.0) s.fail(key, "allowed: 1 or -1");
      signs[i] = values[i];
    }
    return signs;
  };
  c.encoder_sign = sign("encoder_sign");
  c.motor_sign = sign("motor_sign");
  c.R_BS = s.rotation("R_BS");
  c.gyro_bias_B_rad_s = s.vector<3>("gyro_bias_rad_s", -1.0, 1.0);
  if (s.has("accel_scale")) c.accel_scale_S = s.vector<3>("accel_scale", 0.8, 1.2);  // logs before it: 1
  c.accel_bias_B_m_s2 = s.vector<3>("accel_bias_m_s2", -2.0, 2.0);
  s.finish();
  return c;
}

SafetyParams read_safety(Section s) {
  SafetyParams p;
  p.max_tilt_rad = s.number("max_tilt_rad", 0.05, 1.5);
  p.max_arm_tilt_rad = s.number("max_arm_tilt_rad", 0.01, 1.0);
  p.max_fall_rad = s.number("max_fall_rad", 0.05, 10.0);
  p.fall_time_s = s.number("fall_time_s", 0.0, 1.0);
  p.max_arm_rate_rad_s = s.number("max_arm_rate_rad_s", 0.01, 100.0);
  p.max_missed_samples = s.integer("max_missed_samples", 0, 20);
  if (s.has("max_missed_imu")) {  // logs before them: no gap was bridged
    p.max_missed_imu = s.integer("max_missed_imu", 0, 100);
    p.max_missed_encoders = s.integer("max_missed_encoders", 0, 100);
    p.max_missed_both = s.integer("max_missed_both", 0, 40);
    p.max_stalled_ticks = s.integer("max_stalled_ticks", 1, 20);
  }
  p.max_identical_samples = s.integer("max_identical_samples", 0, 1000);
  p.max_attitude_age_ticks = s.integer("max_attitude_age_ticks", 1, 200);
  p.min_battery_V = s.number("min_battery_V", 0.0, 60.0);
  p.cutoff_battery_V = s.number("cutoff_battery_V", 0.0, 60.0);
  if (s.has("detection")) p.detection = s.boolean("detection");
  p.max_innovation = s.number("max_innovation", 1.0, 1000.0);
  p.max_innovation_published = s.number("max_innovation_published", 1.0, 1000.0);
  p.max_innovation_s = s.number("max_innovation_s", 0.0, 10.0);
  p.encoder_check_drive = s.number("encoder_check_drive", 0.0, 0.6);
  if (s.has("encoder_probe_drive"))
    p.encoder_probe_drive = s.number("encoder_probe_drive", 0.0, 0.6);  // logs before it: 0
  p.max_tilt_sigma_rad = s.number("max_tilt_sigma_rad", 0.01, 1.0);
  p.max_bias_drift_rad_s = s.number("max_bias_drift_rad_s", 0.001, 1.0);
  p.max_motor_error = s.number("max_motor_error", 0.01, 1000.0);
  p.max_wheel_rate_rad_s = s.number("max_wheel_rate_rad_s", 1.0, 10000.0);
  if (s.has("max_saturated_s")) (void)s.number("max_saturated_s", 0.01, 60.0);  // logs that had this limit
  p.max_stall_s = s.number("max_stall_s", 0.01, 60.0);
  p.command_timeout_s = s.number("command_timeout_s", 0.05, 60.0);
  s.finish();
  return p;
}

Precision read_precision(Section& s) {
  if (!s.has("precision")) return Precision::kDouble;  // logs before it
  return s.choice("precision", {"single", "double"}) == 0 ? Precision::kSingle : Precision::kDouble;
}

AttitudeFilterParams read_attitude(Section s, const Vec3& imu_position_m) {
  AttitudeFilterParams p;
  p.own = s.choice("source", {"packets", "own"}) == 1;
  p.lever_arm_B_m = imu_position_m;
  p.accel_time_constant_s = s.number("accel_time_constant_s", 0.1, 100.0);
  s.finish();
  return p;
}

namespace {

Chain read_chain(Section s) {
  Chain c;
  c.gyro_delay_s = s.number("gyro_delay_s", 0.0, 0.01);  // two ticks: the filter's memory
  c.accel_delay_s = s.number("accel_delay_s", 0.0, 0.02);
  c.attitude_delay_s = s.number("attitude_delay_s", 0.0, 0.02);
  c.actuation_delay_s = s.number("actuation_delay_s", 0.0, 0.999 * kTickS);
  s.finish();
  return c;
}

ActualScales read_actual(Section s, bool has_ball) {
  ActualScales a;
  const auto scale = [&s](const char* key, double* value) {
    if (s.has(key)) *value = s.number(key, 0.1, 10.0);
  };
  scale("body_mass_scale", &a.body_mass);
  scale("com_height_scale", &a.com_height);
  scale("body_inertia_scale", &a.body_inertia);
  if (has_ball) scale("ball_mass_scale", &a.ball_mass);
  if (has_ball) scale("ball_radius_scale", &a.ball_radius);
  if (!has_ball) scale("track_scale", &a.track);
  scale("wheel_radius_scale", &a.wheel_radius);
  scale("torque_scale", &a.torque);
  scale("back_emf_scale", &a.back_emf);
  s.finish();
  return a;
}

VibrationParams read_vibration(Section s) {
  VibrationParams v;
  v.gyro_sigma_rad_s = s.vector<3>("gyro_sigma_rad_s", 0.0, 2.0);
  v.accel_sigma_m_s2 = s.vector<3>("accel_sigma_m_s2", 0.0, 40.0);
  v.gyro_half_rate_rad_s = s.number("gyro_half_rate_rad_s", 1e-3, 1e3);
  v.accel_half_rate_rad_s = s.number("accel_half_rate_rad_s", 1e-3, 1e3);
  v.centre_hz = s.number("centre_hz", 0.0, 0.5 * kTickHz);
  v.bandwidth_hz = s.number("bandwidth_hz", 0.1, 1e3);
  v.line_share = s.number("line_share", 0.0, 1.0);
  v.lines_per_turn = s.vector<2>("lines_per_turn", 0.0, 1e4);
  v.excess_kurtosis = s.number("excess_kurtosis", 0.0, 100.0);
  v.burst_s = s.number("burst_s", 1e-3, 10.0);
  s.finish();
  return v;
}

FloorParams read_floor(Section s) {
  FloorParams f;
  f.wave_rad = s.number("wave_rad", 0.0, 0.3);
  f.wave_m = s.number("wave_m", 0.01, 1e3);
  f.sill_m = s.number("sill_m", 0.0, 0.01);
  f.sill_every_m = s.number("sill_every_m", 0.01, 1e3);
  f.joint_m = s.number("joint_m", 0.0, 0.01);
  f.tile_m = s.number("tile_m", 0.01, 1e3);
  f.heading_rad = s.number("heading_rad", -10.0, 10.0);
  s.finish();
  return f;
}

RandomPushes read_random_pushes(Section s) {
  RandomPushes p;
  p.every_s = s.number("every_s", 0.0, 1e6);
  p.duration_s = s.number("duration_s", 1e-3, 10.0);
  p.force_N = s.number("force_N", 0.0, 100.0);
  s.finish();
  return p;
}

/// A part by name has its data sheet's noise, too.
void read_imu_part(Section& s, WorldParams* w) {
  std::vector<std::string> names{""};
  for (int i = 0; i < IMU_PARTS; ++i) names.emplace_back(imu_part(i)->name);
  const std::size_t named = s.choice("imu_part", names);
  if (named == 0) return;
  w->imu_part = static_cast<int>(named) - 1;
  if (imu_low_pass(w->imu_part, w->imu_low_pass)->gyro_hz == 0.0)
    s.fail("imu_part", names[named] + " has no imu_low_pass = " + std::to_string(w->imu_low_pass));
  w->gyro_sigma_rad_s = imu_gyro_sigma_rad_s(w->imu_part, w->imu_low_pass);
  w->accel_sigma_m_s2 = imu_accel_sigma_m_s2(w->imu_part, w->imu_low_pass);
}

void read_disturbance(Section& s, WorldParams* w) {
  w->stiction.static_ratio = s.number("static_ratio", 1.0, 5.0);
  w->stiction.rate_rad_s = s.number("stribeck_rate_rad_s", 1e-3, 100.0);
  w->diode_drop_V = s.number("diode_drop_V", 0.0, 3.0);
  const int steps = static_cast<int>(std::lround(kTickS / w->step_s));
  w->actuation_latency_steps = s.integer("actuation_latency_steps", 0, std::max(0, steps - 1));
  w->actuation_delay_ticks = number_or(s, "actuation_delay_ticks", 0.0, 0.0, 0.999);
  if (w->actuation_steps() >= steps) s.fail("actuation_delay_ticks", "with the latency more than a tick");
  w->sensor_latency_ticks = s.integer("sensor_latency_ticks", 0, 3);
  if (s.has("imu_low_pass")) w->imu_low_pass = s.integer("imu_low_pass", 0, IMU_LOW_PASS_MAX);
  if (s.has("imu_part")) read_imu_part(s, w);
  w->imu_delay_scale = number_or(s, "imu_delay_scale", 1.0, 0.0, 2.0);
  w->imu_sample_age_s = number_or(s, "imu_sample_age_s", 0.0, 0.0, 0.01);
  w->encoder_sample_age_s = number_or(s, "encoder_sample_age_s", 0.0, 0.0, 0.01);
  w->imu_misalignment_rad = s.vector<3>("imu_misalignment_rad", -0.5, 0.5);
  w->floor_slope_rad = s.vector<2>("floor_slope_rad", -0.3, 0.3);
  w->rolling_resistance = number_or(s, "rolling_resistance", 0.0, 0.0, 0.5);
  if (s.has("gyro_scale_error")) w->gyro_scale_error = s.vector<3>("gyro_scale_error", -0.2, 0.2);
  if (s.has("gyro_drift_rad_s")) w->gyro_drift_rad_s = s.vector<3>("gyro_drift_rad_s", -0.5, 0.5);
  w->warm_up_s = number_or(s, "warm_up_s", 60.0, 0.1, 1e4);
  if (s.has("accel_scale_error")) w->accel_scale_error = s.vector<3>("accel_scale_error", -0.2, 0.2);
  if (s.has("gyro_drift_rad_s_K")) {
    w->gyro_drift_rad_s_K = s.vector<3>("gyro_drift_rad_s_K", -0.1, 0.1);
    w->warm_K = s.number("warm_K", -100.0, 100.0);
    w->warm_up_K = s.number("warm_up_K", -100.0, 100.0);
  }
  if (s.has("com_offset_rad")) w->com_offset_rad = s.vector<2>("com_offset_rad", -0.3, 0.3);
  if (s.has("friction_scale")) {
    w->friction_scale = s.vector<2>("friction_scale", 0.0, 10.0);
    w->friction_time_s = s.number("friction_time_s", 0.1, 1e4);
  }
  if (s.has("bridge_on_delay_s")) {
    w->bridge_on_delay_s = s.number("bridge_on_delay_s", 0.0, 1e-3);
    w->bridge_off_delay_s = s.number("bridge_off_delay_s", 0.0, 1e-3);
  }
  w->missed_tick_share = number_or(s, "missed_tick_share", 0.0, 0.0, 0.5);
  w->imu_repeat_share = number_or(s, "imu_repeat_share", 0.0, 0.0, 0.5);
}

}  // namespace

LoadedFile loaded(const Document& document) {
  check_population(document.root());
  return {document.keys(), document.sha256(), document.canonical()};
}

WorldParams read_world(Section s, BridgeType* bridge, const RobotsOwn& own) {
  WorldParams w;
  *bridge = s.choice("bridge", kBridgeNames) == 0 ? BridgeType::kDriveBrake : BridgeType::kDriveCoast;
  w.step_s = s.number("step_s", 1e-5, kTickS);
  const double steps = kTickS / w.step_s;
  if (std::abs(steps - std::round(steps)) > 1e-9) s.fail("step_s", "must divide the tick of 0.005 s");
  w.initial_tilt_rad = s.number("initial_tilt_rad", 0.0, 0.3);
  w.friction = s.boolean("friction");
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
  if (s.has("vibration")) w.vibration = read_vibration(s.table("vibration"));
  if (s.has("floor")) w.floor = read_floor(s.table("floor"));
  if (s.has("random_pushes")) w.random_pushes = read_random_pushes(s.table("random_pushes"));
  if (s.has("population")) s.table("population");  // read when a robot is drawn
  if (s.has("actual")) w.actual = read_actual(s.table("actual"), own.has_ball);
  if (s.has("disturbance")) {
    Section disturbance = s.table("disturbance");
    read_disturbance(disturbance, &w);
    own.disturbance(disturbance);
    disturbance.finish();
  }
  s.finish();
  return w;
}

void read_machine(Section& root, int wheels, CommonConfig* c) {
  c->motor = read_motor(root.table("motor"));
  c->calibration = read_calibration(root.table("calibration"), wheels);
  Section friction = root.table("friction");
  c->friction.gain = friction.number("compensation", 0.0, 1.5);
  friction.finish();
}

void read_surroundings(Section& root, const Vec3& imu_position_m,
                       const std::function<void(Section, std::size_t)>& world, CommonConfig* c) {
  c->safety = read_safety(root.table("safety"));
  c->attitude = read_attitude(root.table("attitude"), imu_position_m);
  c->chain = read_chain(root.table("chain"));
  Section worlds = root.table("world");
  for (std::size_t i = 0; i < kFidelityNames.size(); ++i)
    world(worlds.table(world_key(worlds, kFidelityNames[i])), i);
  worlds.finish();
  if (root.has("population")) root.table("population");  // checked and read elsewhere
  root.finish();
}

void refuse(const DesignProblem& problem, const Section& controller, const Section& robot) {
  if (problem.parameter.empty()) controller.fail("design", problem.why);
  robot.fail(problem.parameter, problem.why);
}

}  // namespace config
}  // namespace equipoise
