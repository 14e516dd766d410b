// By how much a motor does other than told. In: disturbance as estimated, command, by wheel -> out: duty.
// A wheel that slips loses its torque for a moment, a dead motor for good: where wheels slip, the disturbance
// counts as far as it has been that share of the command for a time, too. RT-safe.
#pragma once

#include <algorithm>
#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {

template <int Wheels>
class MotorError {
 public:
  /// Of the memory; 0: none.
  explicit MotorError(double time_constant_s) : keep_(std::exp(-kTickS / time_constant_s)) {}
  void reset() noexcept { now_ = felt_ = asked_ = Vec<Wheels>::Zero(); }
  /// Duties: what acts beside the command, the command.
  void update(const Vec<Wheels>& disturbance, const Vec<Wheels>& u) noexcept {
    now_ = disturbance.cwiseAbs2();
    felt_ = keep_ * felt_ + now_;
    asked_ = keep_ * asked_ + u.cwiseAbs2();
  }
  /// Of the worst motor; a dead one: near 1, where it is asked for all.
  double worst() const noexcept {
    double worst = 0.0;
    for (int i = 0; i < Wheels; ++i) worst = std::max(worst, std::min(now_(i), felt_(i) / asked_(i)));
    return std::sqrt(worst);
  }

 private:
  double keep_;                             // per tick
  Vec<Wheels> now_ = Vec<Wheels>::Zero();   // squares
  Vec<Wheels> felt_ = Vec<Wheels>::Zero();  // their sums
  Vec<Wheels> asked_ = Vec<Wheels>::Zero();
};

}  // namespace equipoise
