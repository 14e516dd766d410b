// Margins of a single loop from its frequency response, real or complex. A spinning symmetric robot is a
// complex system: its Nyquist curve is not symmetric, so both signs of frequency count.
// In: L over frequency, of a loop that is stable when closed with -1 -> out: how much it may change. Start-up
// only: allocates.
#pragma once

#include <complex>
#include <vector>

namespace equipoise {

/// Frequencies of both signs, ascending from -Nyquist, denser towards zero and towards `centre_rad_s`, where
/// a turning robot's slow motion lies.
std::vector<double> frequency_grid(double period_s, int points_per_sign, double centre_rad_s);

struct Margins {
  double gain_up_dB = 0.0;
  double gain_down_dB = 0.0;  // negative: by how much the gain may fall
  double phase_deg = 0.0;     // smallest rotation, either way
  double delay_s = 0.0;       // delay margin
  double disk = 0.0;          // 2 / max |S - T|: gain and phase at once
};
/// 1 + L = 0 at the limit of stability. Infinite where nothing in range destabilises. The curve is not
/// followed through zero and `centre_rad_s`, where integrators make it infinite.
Margins margins(const std::vector<double>& omega_rad_s, const std::vector<std::complex<double>>& L,
                double centre_rad_s, double slow_rad_s = 0.0);

}  // namespace equipoise
