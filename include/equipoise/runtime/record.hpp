// What the real-time thread hands over once per tick: one trivially copyable record, and what a run is.
// In: the tick's inputs and results -> out: scalars and arrays for telemetry, log and replay. RT-safe.
// A new field: here, in fields.hpp and in lcm/*.lcm; log, telemetry, replay, CSV, MCAP and Python follow.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <type_traits>

#include "equipoise/estimate/fault_hypotheses.hpp"
#include "equipoise/samples.hpp"

namespace equipoise::runtime {

inline constexpr std::size_t kMaxEstimators = 8;

/// StateView without Eigen.
struct StateRecord {
  std::array<double, 3> theta_rad;
  std::array<double, 3> omega_B_rad_s;
  std::array<double, 2> phi_rad;
  std::array<double, 2> phi_dot_rad_s;
  std::array<double, 2> position_W_m;
  double normalized_innovation;
};

inline StateRecord to_record(const StateView& v) noexcept {
  return {{v.theta_rad.x(), v.theta_rad.y(), v.theta_rad.z()},
          {v.omega_B_rad_s.x(), v.omega_B_rad_s.y(), v.omega_B_rad_s.z()},
          {v.phi_rad.x(), v.phi_rad.y()},
          {v.phi_dot_rad_s.x(), v.phi_dot_rad_s.y()},
          {v.position_W_m.x(), v.position_W_m.y()},
          v.normalized_innovation};
}

inline StateView to_view(const StateRecord& r) noexcept {
  return {Vec3(r.theta_rad.data()),     Vec3(r.omega_B_rad_s.data()), Vec2(r.phi_rad.data()),
          Vec2(r.phi_dot_rad_s.data()), Vec2(r.position_W_m.data()),  r.normalized_innovation};
}

struct TickRecord {
  std::int64_t tick;
  std::int64_t now_ns;  // loop clock; simulated time in simulation
  RawSample raw;
  // command
  std::array<double, 2> velocity_W_m_s;
  double yaw_rate_rad_s;
  bool arm;
  bool heading_reset;
  double command_age_s;
  std::uint32_t inhibit;  // SafetyReason bits of the runtime
  // states: the controlling estimate, the reference, the truth, and the estimators side by side
  StateRecord estimate;
  StateRecord reference;
  StateRecord truth;
  bool has_truth;
  std::uint32_t compared;  // bit i: others[i] is filled
  std::array<StateRecord, kMaxEstimators> others;
  // motors
  std::array<double, 3> u_lin;
  std::array<double, 3> u_friction;
  MotorCommand motors;
  bool saturated;
  std::int32_t motor_count;  // of the robot; the rest of the duties is empty
  // health
  std::int32_t arm_state;
  std::uint32_t reasons;
  std::uint32_t degraded;  // bits of what the robot does without; 0: all is well
  double battery_V;
  FaultEvidence faults;
  // timing
  std::int64_t wake_late_ns;
  std::int64_t compute_ns;
  std::int64_t overruns;
  std::int64_t dropped_records;
};

static_assert(std::is_trivially_copyable_v<TickRecord>, "the hand-over is a memcpy");
static_assert(kMaxEstimators <= 32, "TickRecord::compared has a bit for each");

/// How a run ended: its last event, where it could still write one.
struct EndRecord {
  std::int32_t ended = 0;     // finished, fell, disarmed, interrupted, device
  std::uint32_t reasons = 0;  // SafetyReason bits: when the motors went off, else at the end
  double fell_at_s = 0.0;     // NaN: neither fell nor disarmed
  double duration_s = 0.0;
};

/// What a log is a log of: its first event.
struct RunInfo {
  std::string robot;
  std::string estimator;  // the one that controls
  std::string controller;
  std::string fidelity;  // of the simulated world; empty on hardware
  std::int64_t seed = 0;
  double rolling_radius_m = 0.0;  // of the ball (MBBR) or the wheels (MIP): rolling angle to metres
  std::string version;
  std::string config_sha256;
  std::string config_toml;  // as loaded, overrides applied
  std::string backend;      // sim, board, lockstep
  std::string board_toml;   // on hardware, the wiring
  std::string attitude;     // source: dmp, own; empty: as configured
};

}  // namespace equipoise::runtime
