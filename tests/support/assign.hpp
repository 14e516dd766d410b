// Sets an array of the boundary's C structs in one line: assign(raw.gyro_counts, {1, 2, 3}).
#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>

namespace equipoise {

template <std::size_t To, std::size_t From>
void assign(double (&to)[To], const double (&from)[From]) {
  static_assert(From <= To, "more values than the array holds");
  std::copy(std::begin(from), std::end(from), std::begin(to));
}

}  // namespace equipoise
