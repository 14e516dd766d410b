// Words for what is computed for one robot (Real: double) or for several side by side (Lanes of
// equipoise/plant/lanes.hpp): a branch becomes a choice. RT-safe.
#pragma once

namespace equipoise {

inline bool all(bool mask) noexcept { return mask; }
inline double select(bool mask, double a, double b) noexcept { return mask ? a : b; }
/// As std::clamp.
template <class Real>
Real limited(const Real& x, const Real& low, const Real& high) noexcept {
  return select(x < low, low, select(high < x, high, x));
}

}  // namespace equipoise
