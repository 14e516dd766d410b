// Sections that every robot's configuration has. In: section of the file -> out: typed parameters;
// ConfigError otherwise. Start-up only.
#pragma once

#include <functional>

#include "config/toml_reader.hpp"
#include "equipoise/actuate/bridge.hpp"
#include "equipoise/actuate/safety.hpp"
#include "equipoise/estimate/kalman.hpp"
#include "equipoise/plant/world.hpp"
#include "equipoise/sense/attitude_filter.hpp"
#include "equipoise/sense/calibrate.hpp"

namespace equipoise::config {

/// ConfigError unless the file is for this robot.
void expect_robot(Section& robot, const std::string& type);

MotorParameters read_motor(Section s);
Calibration read_calibration(Section s, int wheels);
SafetyParams read_safety(Section s);
/// Of our own filter; `imu_position_m`: lever arm.
AttitudeFilterParams read_attitude(Section s, const Vec3& imu_position_m);
/// All of a world but its process noise; `bridge`: what the simulated robot is built with. Its table
/// `disturbance`, when there is one, is read by `rest` as well: what only this robot has.
WorldParams read_world(
    Section s, BridgeType* bridge, const std::function<void(Section&)>& rest = [](Section&) {});

template <class Filter>
void read_filter(Section s, typename Filter::Params& params) {
  params.Q = s.vector<Filter::n>("q", 0.0, 1e6);
  params.R = s.vector<Filter::m>("r", 1e-15, 1e6);
  params.input_variance = s.vector<Filter::p>("input_variance", 0.0, 100.0);
  params.initial_variance = s.number("initial_variance", 0.0, 1e3);
  s.finish();
}

}  // namespace equipoise::config
