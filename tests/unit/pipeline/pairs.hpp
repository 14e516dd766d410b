// Inputs and duties of two wheels as lists that a matcher prints.
#pragma once

#include <gmock/gmock.h>

#include <vector>

#include "equipoise/types.hpp"

namespace equipoise::bench {

inline std::vector<double> list(const Vec<2>& v) { return {v(0), v(1)}; }
inline auto near(double a, double b) {
  return testing::ElementsAre(testing::DoubleNear(a, 1e-12), testing::DoubleNear(b, 1e-12));
}

}  // namespace equipoise::bench
