#include "disturbance_config.hpp"

namespace equipoise::config {

MbbrDisturbanceParams read_disturbance(Section s) {
  MbbrDisturbanceParams p;
  p.coulomb_scale = s.number("coulomb_scale", 0.0, 10.0);
  p.static_ratio = s.number("static_ratio", 1.0, 5.0);
  p.stribeck_rate_rad_s = s.number("stribeck_rate_rad_s", 1e-3, 100.0);
  p.extra_viscous_N_m_s = s.number("extra_viscous_N_m_s", 0.0, 1.0);
  p.yaw_friction_scale = s.vector<2>("yaw_friction_scale", 0.0, 10.0);
  p.roller_tilt_rad = s.number("roller_tilt_rad", 0.0, 0.5);
  p.rollers_per_turn = s.number("rollers_per_turn", 1.0, 100.0);
  p.roller_slip_N_m = s.number("roller_slip_N_m", 0.0, 1.0);
  p.backlash_rad = s.number("backlash_rad", 0.0, 0.5);
  p.rotor_inertia_kg_m2 = s.number("rotor_inertia_kg_m2", 1e-8, 1.0);
  p.wheel_torque_scale = s.vector<3>("wheel_torque_scale", 0.0, 2.0);
  p.diode_drop_V = s.number("diode_drop_V", 0.0, 3.0);
  p.wheel_grip = s.number("wheel_grip", 0.0, 5.0);
  p.floor_slope_rad = s.vector<2>("floor_slope_rad", -0.5, 0.5);
  p.imu_misalignment_rad = s.vector<3>("imu_misalignment_rad", -0.5, 0.5);
  p.sensor_latency_ticks = s.integer("sensor_latency_ticks", 0, 3);
  p.actuation_latency_steps = s.integer("actuation_latency_steps", 0, 4);
  s.finish();
  return p;
}

}  // namespace equipoise::config
