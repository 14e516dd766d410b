// The held MBBR driving its ball on a weighted flywheel: [T] section 5.3, Fig. 5.2.
// In: friction, flywheel, sweep -> out: command and flywheel angle as logged. Simulation only; same seed,
// same samples.
#pragma once

#include "equipoise/plant/motor_bench.hpp"

namespace equipoise {

struct FrictionRigParams {
  double k1_N_m = 0.176;
  double k2_ball_N_m_s = 0.011;
  double coulomb_N_m = 0.05265;
  double viscous_N_m_s = 0.001056;
  double static_ratio = 1.0;    // breakaway over Coulomb
  double negative_scale = 1.0;  // Coulomb in the negative direction over the positive one
  double radius_ratio = 1.25;   // flywheel over ball
  double flywheel_inertia_kg_m2 = 1.5e-3;
  double counts_per_rev = 1000.0;
  double torque_noise_N_m = 0.01;  // per sample: rollers, motors
  double amplitude_u = 3.0;        // [T]: 20 s, 0.1 to 2 Hz
  double duration_s = 20.0;
  std::uint64_t seed = 1;
};

/// The current is not measured: NaN.
std::vector<BenchSample> run_friction_rig(const FrictionRigParams& p);

}  // namespace equipoise
