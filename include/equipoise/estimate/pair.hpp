// Two neighbouring entries of a vector of double: one SSE2 register, or two of VFP. For generated code.
// RT-safe.
#pragma once

#include <atomic>

namespace equipoise {

using Pair = double __attribute__((vector_size(16), may_alias));

/// `first`: at a multiple of 16 bytes.
inline Pair load(const double* first) noexcept {
#ifdef __SSE2__
  return *reinterpret_cast<const Pair*>(first);
#else
  return Pair{first[0], first[1]};
#endif
}
inline void store(double* first, Pair both) noexcept {
#ifdef __SSE2__
  *reinterpret_cast<Pair*>(first) = both;
#else  // GCC takes a vector that the processor lacks through the stack
  first[0] = both[0];
  first[1] = both[1];
#endif
}
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
