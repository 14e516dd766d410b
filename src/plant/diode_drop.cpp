#include "equipoise/plant/diode_drop.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise {

// In units of the stall current and the PWM period. Volt-seconds over one period balance:
//   i_avg = (1 - omega_r) v - (opposing + omega_r) t_c,
// with t_c the share of the period in which the diodes conduct.
DriveCoastDropCommand::DriveCoastDropCommand(double T_r, double u) noexcept
    : T_r_(T_r),
      sign_(u < 0.0 ? -1.0 : 1.0),
      v_(std::min(std::abs(u), 1.0)),
      drained_(-std::expm1(-v_ * T_r)) {}

double DriveCoastDropCommand::mean_current(double omega_r, double opposing) const noexcept {
  if (v_ == 0.0) return 0.0;
  const double w = sign_ * std::clamp(omega_r, -1.0, 1.0);
  const double peak = (1.0 - w) * drained_;
  const double dies_after = std::log1p(peak / (opposing + w)) / T_r_;
  return sign_ * ((1.0 - w) * v_ - (opposing + w) * std::min(dies_after, 1.0 - v_));
}

}  // namespace equipoise
