// Motor and friction parameters from bench logs. In: samples -> out: estimates with confidence intervals, or
// the reason why the data cannot give them. Source: [T] (4.3), (5.34)-(5.37). Not RT-safe.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "app/identify/bench_log.hpp"

namespace equipoise::app {

struct Estimate {
  std::string name;  // with its unit
  double value = 0.0;
  double half_width = 0.0;  // 95 %
  double within = 0.25;  // at most this share of the value: zero and four times less or more are far outside
  bool determined() const { return half_width < within * std::abs(value); }
};

struct Identified {
  std::string refused;  // why nothing can be said; empty otherwise
  std::vector<Estimate> estimates;
  double r_squared = 0.0;         // of the voltage (motor) or the acceleration (friction)
  double r_squared_torque = 0.0;  // motor: of the torque, where it moved
  const Estimate* find(const std::string& name) const {
    for (const Estimate& e : estimates) {
      if (e.name == name) return &e;
    }
    return nullptr;
  }
};

/// R, k, L from u V = R (i - i0) + k omega + L di/dt, integrated, i0 being the sensor's zero; then friction
/// from k i = J omega' + friction. `inertia_kg_m2`: of the known flywheel; 0 leaves it to be estimated as
/// well.
Identified identify_motor(const BenchLog& log, double inertia_kg_m2);

struct FrictionRig {
  double k1_N_m = 0.176;
  double k2_ball_N_m_s = 0.011;
  double flywheel_over_ball_radius = std::numeric_limits<double>::quiet_NaN();  // r_f / r; NaN: the log's
  bool separate_directions = false;
  bool stribeck = false;
};
/// J_f, mu_c, mu_v at the ball: k1 u - k2 phi' = J_f (r/r_f) phi_f'' + mu_c sign + mu_v phi'. (5.37), with
/// the ratio's powers put right: torque at the flywheel is torque at the ball times r_f/r.
Identified identify_friction(const BenchLog& log, const FrictionRig& rig);

}  // namespace equipoise::app
