// Every field of a record, once: name and place, message by message, in wire order. What encodes, decodes,
// compares, prints or converts a record visits this list; lcm/*.lcm names the same fields (a test compares).
// In: record, visitor -> out: visit(name, value&) per field. RT-safe as far as the visitor is.
#pragma once

#include <string_view>

#include "equipoise/runtime/record.hpp"
#include "equipoise/runtime/timing.hpp"

namespace equipoise::runtime::fields {

struct Sensors {
  static constexpr const char* kType = "sensors_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("t_ns", r.raw.t_ns);
    field("gyro_counts", r.raw.gyro_counts);
    field("accel_counts", r.raw.accel_counts);
    field("encoder_counts", r.raw.encoder_counts);
    field("battery_counts", r.raw.battery_counts);
    field("imu_temperature_degC", r.raw.imu_temperature_degC);
    field("attitude_wxyz", r.raw.attitude_wxyz);
    field("valid", r.raw.valid);
    field("health", r.raw.health);
  }
};

struct CommandFields {
  static constexpr const char* kType = "command_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("velocity_W_m_s", r.velocity_W_m_s);
    field("yaw_rate_rad_s", r.yaw_rate_rad_s);
    field("arm", r.arm);
    field("heading_reset", r.heading_reset);
    field("age_s", r.command_age_s);
  }
};

/// Of a StateRecord: an estimate, the reference, the truth.
struct State {
  static constexpr const char* kType = "state_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("theta_rad", r.theta_rad);
    field("omega_B_rad_s", r.omega_B_rad_s);
    field("phi_rad", r.phi_rad);
    field("phi_dot_rad_s", r.phi_dot_rad_s);
    field("position_W_m", r.position_W_m);
    field("normalized_innovation", r.normalized_innovation);
  }
};

struct Motors {
  static constexpr const char* kType = "motors_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("motors", r.motor_count);
    field("u_lin", r.u_lin);
    field("u_friction", r.u_friction);
    field("duty", r.motors.duty);
    field("enable", r.motors.enable);
    field("saturated", r.saturated);
  }
};

struct Health {
  static constexpr const char* kType = "health_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("arm_state", r.arm_state);
    field("reasons", r.reasons);
    field("sensor_health", r.raw.health);
    field("battery_V", r.battery_V);
    field("degraded", r.degraded);
    field("inhibit", r.inhibit);
  }
};

/// Of a FaultEvidence.
struct Faults {
  static constexpr const char* kType = "faults_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("leading", r.leading);
    field("ratio", r.ratio);
    field("bound", r.bound);
    field("runner_up", r.runner_up);
    field("runner_up_ratio", r.runner_up_ratio);
    field("decided", r.decided);
    field("verdicts", r.verdicts);
  }
};

struct Timing {
  static constexpr const char* kType = "timing_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("wake_late_ns", r.wake_late_ns);
    field("compute_ns", r.compute_ns);
    field("overruns", r.overruns);
    field("dropped_records", r.dropped_records);
  }
};

/// Once a second, where the loop has a deadline.
struct HistogramRecord {
  std::array<std::int64_t, TimeHistogram::kBins> upper_ns, wake_late, compute;
};
struct Histogram {
  static constexpr const char* kType = "timing_histogram_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("upper_ns", r.upper_ns);
    field("wake_late", r.wake_late);
    field("compute", r.compute);
  }
};

/// Of an EndRecord.
struct End {
  static constexpr const char* kType = "verdict_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("ended", r.ended);
    field("reasons", r.reasons);
    field("fell_at_s", r.fell_at_s);
    field("duration_s", r.duration_s);
  }
};

struct Run {
  static constexpr const char* kType = "run_t";
  template <class Record, class Visit>
  static constexpr void visit(Record& r, Visit&& field) {
    field("seed", r.seed);
    field("rolling_radius_m", r.rolling_radius_m);
    field("robot", r.robot);
    field("estimator", r.estimator);
    field("controller", r.controller);
    field("fidelity", r.fidelity);
    field("version", r.version);
    field("config_sha256", r.config_sha256);
    field("config_toml", r.config_toml);
    field("backend", r.backend);
    field("board_toml", r.board_toml);
    field("attitude", r.attitude);
  }
};

inline constexpr const char* kRunChannel = "EQUIPOISE_RUN";
inline constexpr const char* kSensorsChannel = "EQUIPOISE_SENSORS";
inline constexpr const char* kHistogramChannel = "EQUIPOISE_TIMING_HISTOGRAM";
inline constexpr const char* kEndChannel = "EQUIPOISE_VERDICT";
inline constexpr const char* kTruthChannel = "EQUIPOISE_TRUTH";
inline constexpr const char* kFaultsChannel = "EQUIPOISE_FAULTS";  // where hypotheses are weighed
/// Of an estimator that runs beside the controlling one: this and its name in capitals.
inline constexpr std::string_view kComparedChannel = "EQUIPOISE_STATE_";

/// The messages that every tick has, sensors first: visit(message, channel, record).
template <class Record, class Visit>
constexpr void each_message(Record& r, Visit&& visit) {
  visit(Sensors{}, kSensorsChannel, r);
  visit(CommandFields{}, "EQUIPOISE_COMMAND", r);
  visit(State{}, "EQUIPOISE_STATE", r.estimate);
  visit(State{}, "EQUIPOISE_REFERENCE", r.reference);
  visit(Motors{}, "EQUIPOISE_MOTORS", r);
  visit(Health{}, "EQUIPOISE_HEALTH", r);
  visit(Timing{}, "EQUIPOISE_TIMING", r);
}

}  // namespace equipoise::runtime::fields
