// Two neighbouring entries of a vector of double: one SSE2 register, or two of VFP. For generated code.
// RT-safe.
#pragma once

namespace equipoise {

using Pair = double __attribute__((vector_size(16), may_alias));

/// `first`: at a multiple of 16 bytes.
inline Pair load(const double* first) noexcept { return *reinterpret_cast<const Pair*>(first); }
inline void store(double* first, Pair both) noexcept { *reinterpret_cast<Pair*>(first) = both; }

}  // namespace equipoise
