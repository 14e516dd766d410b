// What scalar measurements that were made independent of each other change: the state and its covariance.
// In: of every row its step or weight, and P h -> x, P, its upper triangle packed by rows that start at even
// columns.
// Two rows of P at once: what is loaded of P h serves both. RT-safe: fixed size.
#pragma once

#include <array>
#include <cstddef>
#ifdef __SSE2__
#include <xmmintrin.h>
#endif

#include "equipoise/estimate/lanes.hpp"

namespace equipoise {

/// x += the sum of step[0] (P h) over m rows; of each further step that sum alone, where `sums` points: what
/// is loaded of P h serves all.
template <int n, int m, class Real, std::size_t further = 0>
void correct(const Real (*step)[m], const Real* Ph, Real* x,
             const std::array<Real*, further>& sums = {}) noexcept {
  using One = OneOf<Real>;
  using Two = TwoOf<Real>;
  Two steps[1 + further][m];
#pragma GCC unroll 3
  for (std::size_t k = 0; k <= further; ++k) {
#pragma GCC unroll 8
    for (std::size_t i = 0; i < m; ++i) steps[k][i] = twice(One(step[k][i]));
  }
  for (std::ptrdiff_t state = 0; state < n; state += 2, Ph += std::ptrdiff_t{2} * m) {
    Two sum[1 + further];
    sum[0] = load(x + state);
#pragma GCC unroll 2
    for (std::size_t k = 1; k <= further; ++k) sum[k] = twice(One(0.0));
#pragma GCC unroll 8
    for (std::size_t i = 0; i < m; ++i) {
      const Two both = load(Ph + 2 * i);
#pragma GCC unroll 3
      for (std::size_t k = 0; k <= further; ++k) sum[k] = plus(sum[k], steps[k][i], both);
    }
    store(x + state, sum[0]);
#pragma GCC unroll 2
    for (std::size_t k = 1; k <= further; ++k) store(sums[k - 1] + state, sum[k]);
  }
}

/// P -= the sum of weight (P h) (P h)' over m rows. Ph[n / 2][m][2]: by pairs of states, rows, state of the
/// pair. The entry that the packing leaves room for in front of odd rows is computed too and means nothing.
template <int n, int m, class Real>
void downdate(const Real* weight, const Real* Ph, Real* P) noexcept {
  using One = OneOf<Real>;
  using Two = TwoOf<Real>;
  static_assert(n % 2 == 0 && m <= 8);
  constexpr std::ptrdiff_t kPair = 2;
  constexpr std::ptrdiff_t kPairs = kPair * m;  // of one pair of states
  for (std::ptrdiff_t length = n; length > 0; length -= kPair) {
    std::array<One, m> even{};
    std::array<One, m> odd{};
#pragma GCC unroll 8
    for (std::size_t i = 0; i < m; ++i) {
      const Two both = twice(One(weight[i])) * load(Ph + 2 * i);
      even[i] = low(both);
      odd[i] = high(both);
    }
    const Real* along = Ph;
#pragma GCC unroll 3
    for (Real* const end = P + length; P != end; P += kPair, along += kPairs) {
      Two first = load(P);
      Two second = load(P + length);
#pragma GCC unroll 8
      for (std::size_t i = 0; i < m; ++i) {
        const Two both = load(along + 2 * i);
        first = less(first, even[i], both);
        second = less(second, odd[i], both);
      }
      store(P, first);
      store(P + length, second);
    }
    P += length;
    Ph += kPairs;
  }
}

#ifdef __SSE2__
/// The same, two rows and two columns in one register.
template <int n, int m>
void downdate(const float* weight, const float* Ph, float* P) noexcept {
  using Four = float __attribute__((vector_size(16), may_alias));
  const auto two = [](const float* from) { return reinterpret_cast<const __m64*>(from); };
  constexpr std::ptrdiff_t kPairs = std::ptrdiff_t{2} * m;  // of one pair of states
  for (std::ptrdiff_t length = n; length > 0; length -= 2) {
    Four factor[m];
#pragma GCC unroll 8
    for (std::ptrdiff_t i = 0; i < m; ++i) {
      const FloatTwo both = twice(weight[i]) * load(Ph + 2 * i);
      factor[i] = Four{both[0], both[0], both[1], both[1]};
    }
    const float* along = Ph;
#pragma GCC unroll 3
    for (float* const end = P + length; P != end; P += 2, along += kPairs) {
      Four block = _mm_loadh_pi(_mm_loadl_pi(_mm_setzero_ps(), two(P)), two(P + length));
#pragma GCC unroll 8
      for (std::ptrdiff_t i = 0; i < m; ++i) {
        const Four both = _mm_loadl_pi(_mm_setzero_ps(), two(along + 2 * i));
        block -= factor[i] * Four(_mm_movelh_ps(both, both));
      }
      _mm_storel_pi(reinterpret_cast<__m64*>(P), block);
      _mm_storeh_pi(reinterpret_cast<__m64*>(P + length), block);
    }
    P += length;
    Ph += kPairs;
  }
}
#endif

}  // namespace equipoise
