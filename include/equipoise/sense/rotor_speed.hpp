// Wheel rates as the slope of a line through the last six encoder samples.
// In: wheel angles, rad, once per tick -> out: wheel rates, rad/s, delayed by 2.5 ticks. Missed ticks are
// interpolated. Source: [T] (6.17)-(6.20). RT-safe.
#pragma once

#include <algorithm>
#include <array>

#include "equipoise/types.hpp"

namespace equipoise {

template <int Wheels>
class RotorSpeed {
 public:
  /// `ticks`: since the last call.
  Vec<Wheels> update(const Vec<Wheels>& angle_rad, int ticks = 1) noexcept {
    if (!primed_) {
      history_.fill(angle_rad);  // no false speed from an encoder that does not start at zero
      primed_ = true;
    }
    const Vec<Wheels> step = (angle_rad - history_[0]) / ticks;
    for (int missed = std::min(ticks, static_cast<int>(kPoints)) - 1; missed > 0; --missed)
      push(angle_rad - missed * step);
    push(angle_rad);
    Vec<Wheels> rate = Vec<Wheels>::Zero();
    for (std::size_t i = 0; i < kPoints; ++i) rate += kSlope[i] * history_[i];
    return rate;
  }

 private:
  void push(const Vec<Wheels>& angle_rad) noexcept {
    for (std::size_t i = kPoints - 1; i > 0; --i) history_[i] = history_[i - 1];
    history_[0] = angle_rad;
  }

  static constexpr std::size_t kPoints = 6;
  static constexpr double kUnit = 1.0 / (35.0 * kTickS);  // least squares: 5, 3, 1, -1, -3, -5 over 35 dt
  static constexpr std::array<double, kPoints> kSlope{5 * kUnit,  3 * kUnit,  1 * kUnit,
                                                      -1 * kUnit, -3 * kUnit, -5 * kUnit};
  std::array<Vec<Wheels>, kPoints> history_{};
  bool primed_ = false;
};

}  // namespace equipoise
