#include "equipoise/plant/diode_drop.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise {

// In units of the stall current and the PWM period. Volt-seconds over one period balance:
//   i_avg = (1 - omega_r) v - (opposing + omega_r) t_c,
// with t_c the share of the period in which the diodes conduct.
double drive_coast_mean_current_with_drop(double T_r, double omega_r, double u, double opposing) noexcept {
  if (u == 0.0) return 0.0;
  const double sign = u < 0.0 ? -1.0 : 1.0;
  const double w = sign * std::clamp(omega_r, -1.0, 1.0);
  const double v = std::min(std::abs(u), 1.0);
  const double peak = (1.0 - w) * -std::expm1(-v * T_r);
  const double dies_after = std::log1p(peak / (opposing + w)) / T_r;
  return sign * ((1.0 - w) * v - (opposing + w) * std::min(dies_after, 1.0 - v));
}

}  // namespace equipoise
