// How a gyro lies: an axis flipped, or two swapped. In: what it says, or the truth -> out: the other. Body
// axes. Swapped axes of a sensor that is mounted on its side swap with their signs. RT-safe.
#pragma once

#include <array>

#include "equipoise/types.hpp"

namespace equipoise {

/// Axis `i` flipped or, where `k` is another, the two swapped; each lie is its own inverse.
struct GyroLie {
  int i;
  int k;
  double sign;
  Vec3 operator()(const Vec3& rate) const noexcept {
    Vec3 r = rate;
    r(i) = sign * rate(k);
    r(k) = sign * rate(i);
    return r;
  }
};

inline constexpr std::array<GyroLie, 9> kGyroLies{{{0, 0, -1.0},
                                                   {1, 1, -1.0},
                                                   {2, 2, -1.0},
                                                   {0, 1, 1.0},
                                                   {1, 2, 1.0},
                                                   {2, 0, 1.0},
                                                   {0, 1, -1.0},
                                                   {1, 2, -1.0},
                                                   {2, 0, -1.0}}};

}  // namespace equipoise
