// A wheel that slips, or a motor that crosses its backlash, turns its encoder alone, by any angle. In: the
// wheels' innovations and their variances -> out: wider variances of the counted angles, before the
// correction. Beyond kSlips standard deviations an innovation corrects the less, the larger it is
// (redescending influence, Hampel 1974): what it does not correct shifts the count, for good, and not the
// motion. Robots whose wheels spin would else follow them. The influence has no jump: two filters that differ
// by rounding stay together. Stateless, RT-safe.
#pragma once

#include <algorithm>
#include <cstddef>

#include "equipoise/types.hpp"

namespace equipoise {

inline constexpr double kSlips = 2.0;     // standard deviations that are no slip: NIS of real logs reaches 4
inline constexpr double kMostSlip = 1e4;  // of the variance: single precision can take it off again

/// `counts(wheels)`: what turning the wheels alone adds to the counted angles, states from `first_state` on.
/// True where a variance was widened: the correction has to be found anew.
template <int Wheels, class Filter, class Counts>
bool widen_by_slip(Filter& filter, int first_row, int first_state, const Counts& counts) noexcept {
  bool slipped = false;
  for (int i = 0; i < Wheels; ++i) {
    const auto row = static_cast<std::size_t>(first_row) + static_cast<std::size_t>(i);
    const double times = filter.row_nis()[row] / (kSlips * kSlips);
    const double beyond = (std::min(times * times, kMostSlip) - 1.0) * filter.row_variance()[row];
    if (!(beyond > 0.0)) continue;  // unused, as expected, or not a number
    filter.widen(first_state, counts(Vec<Wheels>::Unit(i)), beyond);
    slipped = true;
  }
  return slipped;
}

}  // namespace equipoise
