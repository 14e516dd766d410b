#include "equipoise/control/margins.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace equipoise {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTwoPi = 6.283185307179586;

/// Where a sign changes between neighbours, as a share of the step.
double share(double from, double to) { return from / (from - to); }

}  // namespace

std::vector<double> frequency_grid(double period_s, int points_per_sign, double centre_rad_s) {
  const double last = 0.5 * kTwoPi / period_s;
  const double first = 1e-4 * last;
  const double ratio = std::pow(last / first, 1.0 / (points_per_sign - 1));
  std::vector<double> grid;
  double w = first;
  for (int i = 0; i < points_per_sign; ++i, w *= ratio) {
    for (const double at : {w, -w, centre_rad_s + w, centre_rad_s - w}) {
      if (std::abs(at) <= last * (1.0 + 1e-9)) grid.push_back(at);
    }
  }
  std::sort(grid.begin(), grid.end());
  grid.erase(std::unique(grid.begin(), grid.end()), grid.end());
  return grid;
}

Margins margins(const std::vector<double>& omega_rad_s, const std::vector<std::complex<double>>& L,
                double centre_rad_s, double slow_rad_s) {
  Margins m{kInfinity, -kInfinity, kInfinity, kInfinity, kInfinity};
  for (std::size_t i = 0; i < L.size(); ++i) {
    const double distance = std::min(std::abs(omega_rad_s[i]), std::abs(omega_rad_s[i] - centre_rad_s));
    if (distance < slow_rad_s) continue;
    m.disk = std::min(m.disk, 2.0 * std::abs((1.0 + L[i]) / (1.0 - L[i])));
    if (i + 1 == L.size() || omega_rad_s[i] * omega_rad_s[i + 1] < 0.0) continue;
    if ((omega_rad_s[i] - centre_rad_s) * (omega_rad_s[i + 1] - centre_rad_s) < 0.0) continue;
    const std::complex<double> a = -L[i];
    const std::complex<double> b = -L[i + 1];  // both near 1 at the limit of stability
    // Phase: the curve crosses the unit circle.
    const double log_a = std::log(std::abs(a));
    const double log_b = std::log(std::abs(b));
    if (log_a * log_b <= 0.0 && log_a != log_b) {
      const double f = share(log_a, log_b);
      const double angle = std::arg(a) + f * std::arg(b / a);
      const double w = omega_rad_s[i] + f * (omega_rad_s[i + 1] - omega_rad_s[i]);
      const double wrapped = std::remainder(angle, kTwoPi);
      m.phase_deg = std::min(m.phase_deg, std::abs(wrapped) * 360.0 / kTwoPi);
      // A delay d turns L by -w d: forward in time only, whatever the sign of w.
      const double lead = std::fmod(std::copysign(1.0, w) * wrapped + kTwoPi, kTwoPi);
      m.delay_s = std::min(m.delay_s, lead / std::abs(w));
    }
    // Gain: the curve crosses the positive real axis.
    const double turn = std::arg(b / a);
    const double arg_a = std::arg(a);
    if (std::abs(arg_a) < 0.25 * kTwoPi && arg_a * (arg_a + turn) <= 0.0 && turn != 0.0) {
      const double size_dB = 20.0 / std::log(10.0) * (log_a + share(arg_a, arg_a + turn) * (log_b - log_a));
      if (size_dB <= 0.0) m.gain_up_dB = std::min(m.gain_up_dB, -size_dB);
      if (size_dB >= 0.0) m.gain_down_dB = std::max(m.gain_down_dB, -size_dB);
    }
  }
  return m;
}

}  // namespace equipoise
