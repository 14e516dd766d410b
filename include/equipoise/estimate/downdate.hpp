// What a covariance loses to scalar measurements that were made independent of each other.
// In: of every row its weight and P h -> P, its upper triangle packed by rows that start at even columns.
// Two rows of P at once: what is loaded of P h serves both. RT-safe: fixed size.
#pragma once

#include <array>
#include <cstddef>

#include "equipoise/estimate/pair.hpp"

namespace equipoise {

/// P -= the sum of weight (P h) (P h)' over m rows. Ph[n / 2][m][2]: by pairs of states, rows, state of the
/// pair. The entry that the packing leaves room for in front of odd rows is computed too and means nothing.
template <int n, int m>
void downdate(const double* weight, const double* Ph, double* P) noexcept {
  static_assert(n % 2 == 0 && m <= 8);
  constexpr std::ptrdiff_t kPair = 2;
  constexpr std::ptrdiff_t kPairs = kPair * m;  // of one pair of states
  for (std::ptrdiff_t length = n; length > 0; length -= kPair) {
    std::array<double, m> even{};
    std::array<double, m> odd{};
#pragma GCC unroll 8
    for (std::size_t i = 0; i < m; ++i) {
      const Pair both = weight[i] * load(Ph + 2 * i);
      even[i] = both[0];
      odd[i] = both[1];
    }
    const double* along = Ph;
#pragma GCC unroll 3
    for (double* const end = P + length; P != end; P += kPair, along += kPairs) {
      Pair first = load(P);
      Pair second = load(P + length);
#pragma GCC unroll 8
      for (std::size_t i = 0; i < m; ++i) {
        const Pair both = load(along + 2 * i);
        first -= even[i] * both;
        second -= odd[i] * both;
      }
      store(P, first);
      store(P + length, second);
    }
    P += length;
    Ph += kPairs;
  }
}

}  // namespace equipoise
