#include "equipoise/plant/friction_rig.hpp"

#include <algorithm>
#include <limits>

namespace equipoise {

std::vector<BenchSample> run_friction_rig(const FrictionRigParams& p) {
  constexpr double kSample_s = kTickS;
  constexpr int kSubsteps = 50;
  constexpr double kLow_hz = 0.1;
  constexpr double kHigh_hz = 2.0;
  constexpr double kStribeck_rad_s = 1.0;
  NoiseStream noise(p.seed, 201);
  const double h = kSample_s / kSubsteps;
  const double inertia = p.flywheel_inertia_kg_m2 / (p.radius_ratio * p.radius_ratio);  // at the ball
  const double count_rad = 2.0 * kPi / p.counts_per_rev;
  double rate = 0.0;  // of the ball
  double angle = 0.0;
  std::vector<BenchSample> log;
  const auto samples = static_cast<int>(std::lround(p.duration_s / kSample_s));
  for (int k = 0; k < samples; ++k) {
    const double t = k * kSample_s;
    const double slope = (kHigh_hz - kLow_hz) / p.duration_s;
    const double u = p.amplitude_u * std::sin(2.0 * kPi * (kLow_hz * t + 0.5 * slope * t * t));
    const double disturbance = noise.gaussian(p.torque_noise_N_m);
    for (int i = 0; i < kSubsteps; ++i) {
      const double drive = p.k1_N_m * u - (p.k2_ball_N_m_s + p.viscous_N_m_s) * rate + disturbance;
      const double free = rate + drive * h / inertia;
      const double slow = rate / kStribeck_rad_s;
      const double limit = p.coulomb_N_m * (free < 0.0 ? p.negative_scale : 1.0) *
                           (1.0 + (p.static_ratio - 1.0) * std::exp(-slow * slow));
      const double stop = limit * h / inertia;
      const double next = free - std::clamp(free, -stop, stop);
      angle += 0.5 * (rate + next) * h;
      rate = next;
    }
    BenchSample s;
    s.t_s = t + kSample_s;
    s.u = u;
    s.current_A = std::numeric_limits<double>::quiet_NaN();
    s.angle_rad = count_rad * std::floor(angle / p.radius_ratio / count_rad + 0.5);
    log.push_back(s);
  }
  return log;
}

}  // namespace equipoise
