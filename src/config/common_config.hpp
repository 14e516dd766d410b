// Sections that every robot's configuration has. In: section of the file -> out: typed parameters;
// ConfigError otherwise. Start-up only.
#pragma once

#include <functional>

#include "config/toml_reader.hpp"
#include "equipoise/actuate/bridge.hpp"
#include "equipoise/actuate/safety.hpp"
#include "equipoise/control/governor.hpp"
#include "equipoise/control/plausible.hpp"
#include "equipoise/estimate/kalman.hpp"
#include "equipoise/estimate/lanes.hpp"
#include "equipoise/plant/world.hpp"
#include "equipoise/sense/attitude_filter.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "robots/common/config.hpp"

namespace equipoise::config {

/// ConfigError unless the file is for this robot.
void expect_robot(Section& robot, const std::string& type);

/// ConfigError when compensated friction takes all that a command may ask for.
void require_room(const Section& reference, const DutyBudget& budget);

MotorParameters read_motor(Section s);
Calibration read_calibration(Section s, int wheels);
SafetyParams read_safety(Section s);
Precision read_precision(Section& s);
/// Of our own filter; `imu_position_m`: lever arm.
AttitudeFilterParams read_attitude(Section s, const Vec3& imu_position_m);
/// Motor, calibration and friction compensation.
void read_machine(Section& root, int wheels, CommonConfig* c);
/// Safety, attitude filter, delays, population and, by `world`, the worlds by level: the rest of the file.
void read_surroundings(Section& root, const Vec3& imu_position_m,
                       const std::function<void(Section, std::size_t)>& world, CommonConfig* c);

/// A design that does not exist, at the key that is the cause.
[[noreturn]] void refuse(const DesignProblem& problem, const Section& controller, const Section& robot);

/// When all of it has been read.
LoadedFile loaded(const Document& document);

/// What of a world only one robot has.
struct RobotsOwn {
  bool has_ball = false;
  std::function<void(Section&)> disturbance = [](Section&) {};  // its keys of the table `disturbance`
};
/// All of a world but its process noise; `bridge`: what the simulated robot is built with.
WorldParams read_world(Section s, BridgeType* bridge, const RobotsOwn& own = {});

template <class Filter>
void read_filter(Section s, typename Filter::Params& params) {
  params.Q = s.vector<Filter::n>("q", 0.0, 1e6);
  params.R = s.vector<Filter::m>("r", 1e-15, 1e6);
  params.input_variance = s.vector<Filter::p>("input_variance", 0.0, 100.0);
  params.initial_variance.setConstant(s.number("initial_variance", 0.0, 1e3));
  s.finish();
}

}  // namespace equipoise::config
