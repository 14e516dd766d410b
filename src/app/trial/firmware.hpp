// A robot's firmware and its simulated world, whatever the robot: what sim, run, replay and campaigns work
// with. In: configuration, choices -> out: one virtual call per tick. tick() is RT-safe, the rest is start-up
// and simulation.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "equipoise/actuate/safety.hpp"
#include "equipoise/config.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/overrides.hpp"
#include "equipoise/plant/ticked_world.hpp"
#include "equipoise/runtime/record.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "robots/common/choice.hpp"

namespace equipoise::app {

// Of the robots, for what is qualified with app::.
using equipoise::Choice;
using equipoise::fidelity_level;

/// A simulated robot and its surroundings.
class World : public SimulatedDevices, NoCopy {
 public:
  /// No packets of the attitude source, where nobody reads them.
  virtual void without_attitude() noexcept = 0;
  /// With the dimensions that the firmware is configured with.
  virtual StateView truth() const noexcept = 0;
};

/// One configured pipeline.
class Firmware : NoCopy {
 public:
  virtual ~Firmware() = default;

  /// Everything of the tick but its number, its timing and the truth.
  virtual runtime::TickRecord tick(const RawSample& raw, const Command& asked,
                                   const LoopState& loop) noexcept = 0;

  /// `estimator`: its place in RobotType::estimators. One that runs is in TickRecord::others.
  virtual bool runs(std::size_t estimator) const noexcept = 0;
  virtual bool reads_attitude() const noexcept = 0;
  virtual StateErrors errors_of(const StateView& x, const StateView& truth) const noexcept = 0;

  /// What the estimator `truth` returns from now on; of a world of the same robot, or of a log, where that
  /// holds all of it.
  virtual void observe_truth(const World& world) noexcept = 0;
  virtual void observe_truth(const runtime::StateRecord& logged) noexcept = 0;
};

struct RobotType;

/// Firmware of a recorded run and, beside it, of another tuning, whose estimators take the inputs that those
/// of the first one were given: tick by tick, `recorded` first.
struct Retuning {
  std::unique_ptr<Firmware> recorded, changed;
};

/// A robot's configuration as it was read.
class ConfiguredRobot : NoCopy {
 public:
  virtual ~ConfiguredRobot() = default;

  virtual std::unique_ptr<Firmware> firmware(const Choice& choice) const = 0;
  /// `choice.fidelity` names the world.
  virtual std::unique_ptr<World> world(const Choice& choice, std::uint64_t seed) const = 0;
  /// `changed`: of the same robot type, under the same controller.
  virtual Retuning retuning(const Choice& choice, const ConfiguredRobot& changed,
                            const Choice& changed_choice) const = 0;

  const RobotType* type = nullptr;
  std::string sha256, toml;
  std::vector<KeyFacts> keys;
  Calibration calibration;
  SafetyParams safety;
  double rolling_radius_m = 0.0;
  double max_acceleration_m_s2 = 0.0;
};

/// A robot of this build.
struct RobotType {
  const char* name;
  std::vector<std::string> estimators, controllers;
  const char* default_estimator;
  const char* default_controller;
  const char* speed_rmse_key;
  const char* speed_label;
  const char* speed_unit;
  double speed_scale;  // to that unit
  bool drives_sideways;
  double forward_rad;  // heading of a drive forward at yaw 0, from x
  std::unique_ptr<const ConfiguredRobot> (*load)(const std::string& path, const Overrides& overrides);
  std::unique_ptr<const ConfiguredRobot> (*parse)(const std::string& text, const std::string& origin,
                                                  const std::vector<std::string>& set);
};

/// Robot types of this build, and the one of this name; ConfigError when there is none. `where`: file, for
/// the message.
const std::vector<const RobotType*>& robot_types();
const RobotType& robot_type_of(const std::string& name, const std::string& where);
/// As its file says.
std::unique_ptr<const ConfiguredRobot> load_robot(const std::string& path, const Overrides& overrides);

/// Of all robots, for help texts: "mbbr: a, b".
std::string known_estimators();
std::string known_controllers();

/// ConfigError unless estimator and controller are known to this robot; empty ones become its defaults.
void complete(const RobotType& robot, Choice* choice);

/// First event of the log.
runtime::RunInfo run_info(const ConfiguredRobot& robot, const Choice& choice, std::int64_t seed);

}  // namespace equipoise::app
