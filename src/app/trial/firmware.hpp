// What sim, run and replay share of a robot's firmware: checked choices, the log's first event, the tick's
// record. In: configuration, choices, results -> out: the same as records. record_tick is RT-safe, the rest
// is start-up only.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/text/version.hpp"
#include "equipoise/config.hpp"
#include "equipoise/runtime/record.hpp"
#include "robots/robot_list.hpp"

namespace equipoise::app {

// Of the robots, for what is qualified with app::.
using equipoise::Choice;
using equipoise::fidelity_level;
using equipoise::MbbrFirmware;
using equipoise::MipFirmware;
using equipoise::with_robot;

/// Of all robots, for help texts: "mbbr: a, b".
std::string known_estimators();
std::string known_controllers();

/// ConfigError unless estimator and controller are known to this robot; empty ones become its defaults.
template <class Firmware>
void complete(Choice& choice) {
  const auto check = [](const std::string& what, const std::string& value,
                        const std::vector<std::string>& names) {
    std::string allowed;
    for (const std::string& name : names) {
      if (name == value) return;
      allowed += (allowed.empty() ? "" : ", ") + name;
    }
    throw ConfigError("--" + what + " " + value + ": not known to " + Firmware::kName +
                      "; allowed: " + allowed);
  };
  if (choice.estimator.empty()) choice.estimator = Firmware::kDefaultEstimator;
  if (choice.controller.empty()) choice.controller = Firmware::kDefaultController;
  check("estimator", choice.estimator, Firmware::estimators());
  check("controller", choice.controller, Firmware::controllers());
}

/// First event of the log.
template <class Firmware>
runtime::RunInfo run_info(const typename Firmware::Loaded& loaded, const Choice& choice, std::int64_t seed) {
  runtime::RunInfo run;
  run.attitude = choice.attitude;
  run.robot = Firmware::kName;
  run.estimator = choice.estimator;
  run.controller = choice.controller;
  run.fidelity = choice.fidelity;
  run.seed = seed;
  run.rolling_radius_m = Firmware::rolling_radius_m(loaded.config);
  run.version = version();
  run.config_sha256 = loaded.sha256;
  run.config_toml = loaded.toml;
  return run;
}

/// Everything of one tick but truth and timing.
template <class Pipeline>
void record_tick(std::int64_t tick, std::int64_t now_ns, const RawSample& raw, const Command& command,
                 const typename Pipeline::Result& t, const Pipeline& pipeline,
                 runtime::TickRecord* record) noexcept {
  const auto& robot = pipeline.params().robot;
  record->tick = tick;
  record->now_ns = now_ns;
  record->raw = raw;
  record->velocity_W_m_s = {command.velocity_W_m_s.x(), command.velocity_W_m_s.y()};
  record->yaw_rate_rad_s = command.yaw_rate_rad_s;
  record->arm = command.arm;
  record->heading_reset = command.heading_reset;
  record->command_age_s = command.age_s;
  record->inhibit = t.inhibit;
  record->estimate = runtime::to_record(view(t.x_hat, robot));
  record->reference = runtime::to_record(view(t.ref, robot));
  using Estimators = std::decay_t<decltype(pipeline.estimators())>;
  constexpr int kInputs = std::decay_t<decltype(t.u_lin)>::RowsAtCompileTime;
  constexpr int kWheels = Pipeline::Wheels::RowsAtCompileTime;
  static_assert(Estimators::kCount <= runtime::kMaxEstimators, "make room in TickRecord::others");
  static_assert(kInputs > 0 && kInputs <= std::tuple_size_v<decltype(record->u_lin)>, "make room in u_lin");
  static_assert(kWheels > 0 && kWheels <= kMaxMotors, "make room in rio_motors_t");
  record->compared = 0;
  for (std::size_t i = 0; i < Estimators::kCount && pipeline.params().estimators.compare; ++i) {
    const auto id = static_cast<typename Estimators::Id>(i);
    record->others[i] = runtime::to_record(view(pipeline.estimators().estimate(id), robot));
    record->compared |= 1U << i;
  }
  record->motors = kWheels;
  record->degraded = t.degraded;
  for (int i = 0; i < kInputs; ++i) {
    record->u_lin[static_cast<std::size_t>(i)] = t.u_lin(i);
    record->u_friction[static_cast<std::size_t>(i)] = t.u_friction(i);
  }
  std::copy(std::begin(t.motors.duty), std::end(t.motors.duty), record->duty.begin());
  record->enable = t.motors.enable;
  record->saturated = t.saturated;
  record->arm_state = static_cast<std::int32_t>(t.arm_state);
  record->reasons = t.reasons;
  record->battery_V = t.z.battery_V;
}

}  // namespace equipoise::app
