// A wheel that slips, or a motor that crosses its backlash, turns its encoder alone, by any angle. In: the
// wheels' innovations and their variances -> out: wider variances of the counted angles, before the
// correction: what is not corrected shifts the count, for good, and not the motion. How much is corrected has
// no jump: two filters that differ by rounding stay together. Stateless, RT-safe.
#pragma once

#include <cstddef>

#include "equipoise/types.hpp"

namespace equipoise {

/// `widens(wheel, nis)`: to which multiple of its variance; up to 1: no slip. `counts(wheels)`: what turning
/// the wheels alone adds to the counted angles, states from `first_state` on. True where a variance was
/// widened: the correction has to be found anew.
template <int Wheels, class Filter, class Widens, class Counts>
bool widen_by_slip(Filter& filter, int first_row, int first_state, const Widens& widens,
                   const Counts& counts) noexcept {
  bool slipped = false;
  for (int i = 0; i < Wheels; ++i) {
    const auto row = static_cast<std::size_t>(first_row) + static_cast<std::size_t>(i);
    const double beyond = (widens(i, filter.row_nis()[row]) - 1.0) * filter.row_variance()[row];
    if (!(beyond > 0.0)) continue;  // unused, as expected, or not a number
    filter.widen(first_state, counts(Vec<Wheels>::Unit(i)), beyond);
    slipped = true;
  }
  return slipped;
}

}  // namespace equipoise
