// What generated filters compute with, of double or float: One, a value in a register, and Two, neighbouring
// entries of a vector in one. On NEON a float is a lane of a vector, for scalars would go through VFP, which
// blocks; the numbers are those of other processors to the bit, but for values below 1e-38, which are 0
// there. RT-safe.
#pragma once

#include <atomic>
#ifdef __ARM_NEON
#include <arm_neon.h>
#endif

/// Also where the compiler is asked for small code: a vector that a call takes goes through memory.
#define EQUIPOISE_INLINE [[gnu::always_inline]] inline

namespace equipoise {

enum class Precision { kSingle, kDouble };

using Pair = double __attribute__((vector_size(16), may_alias));

/// `first`: at a multiple of 16 bytes.
EQUIPOISE_INLINE Pair load(const double* first) noexcept {
#ifdef __SSE2__
  return *reinterpret_cast<const Pair*>(first);
#else
  return Pair{first[0], first[1]};
#endif
}
EQUIPOISE_INLINE void store(double* first, Pair both) noexcept {
#ifdef __SSE2__
  *reinterpret_cast<Pair*>(first) = both;
#else  // GCC takes a vector that the processor lacks through the stack
  first[0] = both[0];
  first[1] = both[1];
#endif
}

#ifdef __ARM_NEON
namespace neon {

/// kind: 1 or 2, how many lanes count.
template <int kind>
struct Lanes {
  float32x2_t lanes;
  Lanes() = default;
  EQUIPOISE_INLINE explicit Lanes(float32x2_t both) noexcept : lanes(both) {}
  EQUIPOISE_INLINE explicit Lanes(const float& at) noexcept : lanes(vld1_dup_f32(&at)) {}
  EQUIPOISE_INLINE explicit Lanes(double constant) noexcept
      : lanes(vdup_n_f32(static_cast<float>(constant))) {}
  EQUIPOISE_INLINE Lanes(const Lanes<1>& low, const Lanes<1>& high) noexcept
      : lanes(vreinterpret_f32_u64(
            vsli_n_u64(vreinterpret_u64_f32(low.lanes), vreinterpret_u64_f32(high.lanes), 32))) {}

  EQUIPOISE_INLINE friend Lanes operator+(Lanes a, Lanes b) noexcept {
    return Lanes(vadd_f32(a.lanes, b.lanes));
  }
  EQUIPOISE_INLINE friend Lanes operator-(Lanes a, Lanes b) noexcept {
    return Lanes(vsub_f32(a.lanes, b.lanes));
  }
  EQUIPOISE_INLINE friend Lanes operator-(Lanes a) noexcept { return Lanes(vneg_f32(a.lanes)); }
  EQUIPOISE_INLINE friend Lanes operator*(Lanes a, Lanes b) noexcept {
    return Lanes(vmul_f32(a.lanes, b.lanes));
  }
  /// The product is rounded before it is added.
  EQUIPOISE_INLINE friend Lanes plus(Lanes sum, Lanes a, Lanes b) noexcept {
    return Lanes(vmla_f32(sum.lanes, a.lanes, b.lanes));
  }
  EQUIPOISE_INLINE friend Lanes minus(Lanes sum, Lanes a, Lanes b) noexcept {
    return Lanes(vmls_f32(sum.lanes, a.lanes, b.lanes));
  }
};

}  // namespace neon

using FloatOne = neon::Lanes<1>;
using FloatTwo = neon::Lanes<2>;
using StoredTwo = float32x2_t __attribute__((may_alias));

EQUIPOISE_INLINE FloatTwo load(const float* first) noexcept {
  return FloatTwo(*reinterpret_cast<const StoredTwo*>(first));
}
EQUIPOISE_INLINE void store(float* first, FloatTwo both) noexcept {
  *reinterpret_cast<StoredTwo*>(first) = both.lanes;
}
EQUIPOISE_INLINE void store(float* at, FloatOne value) noexcept { vst1_lane_f32(at, value.lanes, 0); }
EQUIPOISE_INLINE FloatOne low(FloatTwo both) noexcept { return FloatOne(both.lanes); }
EQUIPOISE_INLINE FloatOne high(FloatTwo both) noexcept { return FloatOne(vdup_lane_f32(both.lanes, 1)); }
EQUIPOISE_INLINE FloatTwo twice(FloatOne value) noexcept { return FloatTwo(vdup_lane_f32(value.lanes, 0)); }
EQUIPOISE_INLINE FloatOne inverse(FloatOne value) noexcept {
  const float quotient = 1.0F / vget_lane_f32(value.lanes, 0);
  return FloatOne(vdup_n_f32(quotient));
}
EQUIPOISE_INLINE FloatOne select(bool flag, FloatOne value) noexcept {
  const uint32x2_t mask = vdup_n_u32(flag ? ~0U : 0U);
  return FloatOne(vreinterpret_f32_u32(vand_u32(vreinterpret_u32_f32(value.lanes), mask)));
}
/// sum - factor * both
EQUIPOISE_INLINE FloatTwo less(FloatTwo sum, FloatOne factor, FloatTwo both) noexcept {
  return FloatTwo(vmls_lane_f32(sum.lanes, both.lanes, factor.lanes, 0));
}
#else
using FloatOne = float;
using FloatTwo = float __attribute__((vector_size(8), may_alias));

EQUIPOISE_INLINE FloatTwo load(const float* first) noexcept {
  return *reinterpret_cast<const FloatTwo*>(first);
}
EQUIPOISE_INLINE void store(float* first, FloatTwo both) noexcept {
  *reinterpret_cast<FloatTwo*>(first) = both;
}
EQUIPOISE_INLINE void store(float* at, float value) noexcept { *at = value; }
EQUIPOISE_INLINE float low(FloatTwo both) noexcept { return both[0]; }
EQUIPOISE_INLINE float high(FloatTwo both) noexcept { return both[1]; }
EQUIPOISE_INLINE FloatTwo twice(float value) noexcept { return FloatTwo{value, value}; }
EQUIPOISE_INLINE float inverse(float value) noexcept { return 1.0F / value; }
EQUIPOISE_INLINE float select(bool flag, float value) noexcept { return flag ? value : 0.0F; }
EQUIPOISE_INLINE FloatTwo less(FloatTwo sum, float factor, FloatTwo both) noexcept {
  return sum - factor * both;
}
#endif

EQUIPOISE_INLINE void store(double* at, double value) noexcept { *at = value; }
EQUIPOISE_INLINE double low(Pair both) noexcept { return both[0]; }
EQUIPOISE_INLINE double high(Pair both) noexcept { return both[1]; }
EQUIPOISE_INLINE Pair twice(double value) noexcept { return Pair{value, value}; }
EQUIPOISE_INLINE double inverse(double value) noexcept { return 1.0 / value; }
EQUIPOISE_INLINE double select(bool flag, double value) noexcept { return flag ? value : 0.0; }
EQUIPOISE_INLINE Pair less(Pair sum, double factor, Pair both) noexcept { return sum - factor * both; }

/// sum + a * b; NEON has an instruction for it.
template <class T>
EQUIPOISE_INLINE T plus(T sum, T a, T b) noexcept {
  return sum + a * b;
}
template <class T>
EQUIPOISE_INLINE T minus(T sum, T a, T b) noexcept {
  return sum - a * b;
}

template <class Real>
struct LanesOf;
template <>
struct LanesOf<double> {
  using One = double;
  using Two = Pair;
};
template <>
struct LanesOf<float> {
  using One = FloatOne;
  using Two = FloatTwo;
};
template <class Real>
using OneOf = typename LanesOf<Real>::One;
template <class Real>
using TwoOf = typename LanesOf<Real>::Two;

/// In front of a function: compiled for AVX-512, too, and chosen when the program starts. A fifth fewer
/// instructions and, as nothing is fused, the same numbers to the bit; for AVX2 it would be a sixth, but
/// Valgrind, which counts them, does not know all of that. Not where a sanitizer's code would run before the
/// sanitizer has been set up.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define EQUIPOISE_AVX512_TOO [[gnu::target_clones("arch=x86-64-v4", "default")]]
#else
#define EQUIPOISE_AVX512_TOO
#endif

/// What was stored is loaded again when it is needed, not kept on a stack too large for the loads' offsets.
[[gnu::always_inline]] inline void settle() noexcept { std::atomic_signal_fence(std::memory_order_seq_cst); }

}  // namespace equipoise
