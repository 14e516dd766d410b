// A wheel that slips, or a motor that crosses its backlash, turns its encoder alone, by any angle. In: the
// wheels' innovations and their variances -> out: wider variances of the counted angles, before the
// correction. An innovation of more than `sigmas` standard deviations then corrects as much as one of just
// that (Huber 1965): what exceeds it shifts the count, for good, and not the motion. It never corrects less
// than a smaller one would: two filters that differ by rounding stay together. Stateless, RT-safe.
#pragma once

#include <cmath>
#include <cstddef>

#include "equipoise/types.hpp"

namespace equipoise {

/// `counts(wheels)`: what turning the wheels alone adds to the counted angles, states from `first_state` on.
/// True where a variance was widened: the correction has to be found anew.
template <int Wheels, class Filter, class Counts>
bool widen_by_slip(Filter& filter, int first_row, int first_state, double sigmas,
                   const Counts& counts) noexcept {
  bool slipped = false;
  for (int i = 0; i < Wheels; ++i) {
    const auto row = static_cast<std::size_t>(first_row) + static_cast<std::size_t>(i);
    const double beyond = (std::sqrt(filter.row_nis()[row]) / sigmas - 1.0) * filter.row_variance()[row];
    if (!(beyond > 0.0)) continue;  // unused, as expected, or not a number
    filter.widen(first_state, counts(Vec<Wheels>::Unit(i)), beyond);
    slipped = true;
  }
  return slipped;
}

}  // namespace equipoise
