// Which wheel is which: axes of a ball-bot's wheels as measured, against the configured ones.
// In: columns of axes, body frame -> out: the permutation, signs and rotation about z that explain the
// measured ones with the fewest changes, and the mistake in words. Source: geometry. Not RT-safe.
#pragma once

#include <array>
#include <string>

#include "equipoise/types.hpp"

namespace equipoise::app {

struct WheelOrder {
  std::array<int, 3> at{0, 1, 2};  // wheel of the configuration that each column is
  std::array<int, 3> sign{1, 1, 1};
  double azimuth_rad = 0.0;  // beyond the configured one
  std::string mistake;       // empty: as configured
};

WheelOrder wheel_order(const Mat3& configured, const Mat3& measured);

}  // namespace equipoise::app
