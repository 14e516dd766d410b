// How far a value has gone lately that may only creep. In: value, how far known causes may have moved it, for
// as long as the mean remembers or for a moment -> out: its distance from its own mean over the last 20 s,
// less what the causes explain. A gyro's bias follows the temperature; one that is elsewhere within a second
// is a gyro that lies, or a filter that explains something else by it. RT-safe.
#pragma once

#include <algorithm>

#include "equipoise/types.hpp"

namespace equipoise {

template <int N>
class SlowDrift {
 public:
  static constexpr double kFoundAnew_rad_s = 0.15;  // of a bias that has jumped: what one noisy sample leaves

  void reset(const Vec<N>& value) noexcept {
    value_ = mean_ = value;
    explained_ = passing_ = 0.0;
  }
  void update(const Vec<N>& value, double explained, double passing) noexcept {
    value_ = value;
    mean_ += kTickS / kTimeConstant_s * (value - mean_);
    // The mean comes back from where the cause had taken it no sooner than this forgets.
    explained_ = std::max(explained, (1.0 - kTickS / kTimeConstant_s) * explained_);
    passing_ = std::max(passing, (1.0 - kTickS / kPassing_s) * passing_);
  }
  /// A cause that has moved it once, and for good.
  void excuse(double explained) noexcept { explained_ = std::max(explained_, explained); }
  double distance() const noexcept { return std::max(0.0, (value_ - mean_).norm() - explained_ - passing_); }

 private:
  static constexpr double kTimeConstant_s = 20.0;
  static constexpr double kPassing_s = 1.0;
  Vec<N> value_ = Vec<N>::Zero();
  Vec<N> mean_ = Vec<N>::Zero();
  double explained_ = 0.0;
  double passing_ = 0.0;
};

}  // namespace equipoise
