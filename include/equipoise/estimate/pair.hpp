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
/// What was stored is loaded again when it is needed, not kept on a stack too large for the loads' offsets.
[[gnu::always_inline]] inline void settle() noexcept { std::atomic_signal_fence(std::memory_order_seq_cst); }

}  // namespace equipoise
