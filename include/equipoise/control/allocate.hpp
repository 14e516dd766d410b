// Shares the wheels' limited duty: what comes first is kept whole as long as it fits alone.
// In: two demands per wheel, limit -> out: wheels within it. Stateless, RT-safe.
#pragma once

#include <algorithm>

#include "equipoise/types.hpp"

namespace equipoise {

/// `first`, and as much of `second` as every wheel has room for. When `first` alone does not fit, all of it
/// shrinks alike: its direction is what balances.
template <int N>
Vec<N> within(const Vec<N>& first, const Vec<N>& second, double limit) noexcept {
  const double largest = first.cwiseAbs().maxCoeff();
  if (!(largest <= limit)) return first * (limit / largest);
  double share = 1.0;
  for (int i = 0; i < N; ++i) {
    const double sum = first(i) + second(i);
    if (std::abs(sum) > limit) share = std::min(share, (std::copysign(limit, sum) - first(i)) / second(i));
  }
  return first + share * second;
}

}  // namespace equipoise
