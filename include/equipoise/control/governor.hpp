// Makes a command feasible: velocity that follows a target with bounded acceleration and bounded change of
// it, and targets that leave each wheel a share of its duty for balance. In: target -> out: velocity,
// acceleration, its rate. Keeps: the first two. RT-safe.
#pragma once

#include <algorithm>
#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {

/// Velocity in N directions; reaches the target without overshoot. Its jerk is fed forward, so that it must
/// not be the law's own chatter, also while the target moves: a path, a stick.
template <int N>
class SmoothVelocity {
 public:
  struct Limits {
    double acceleration;  // units/s^2
    double jerk;          // units/s^3; infinite: a plain slew limit, whose steps have no rate to feed forward
  };

  void reset() noexcept { *this = SmoothVelocity{}; }

  void update(const Vec<N>& target, const Limits& limits) noexcept {
    const Vec<N> missing = target - velocity_;
    const double length = missing.norm();
    // What can still be taken back by the target, a tick being gone by then, and no more than reaches it now.
    const double left = std::max(0.0, length - kTickS * acceleration_.norm());
    const double size = std::min({limits.acceleration, closing(left, limits.jerk), length / kTickS});
    const Vec<N> wish = length > 0.0 ? Vec<N>(missing * (size / length)) : Vec<N>(Vec<N>::Zero());
    const Vec<N> change = wish - acceleration_;
    const double step = limits.jerk * kTickS;
    const double change_length = change.norm();
    const Vec<N> before = acceleration_;
    acceleration_ += change_length > step ? Vec<N>(change * (step / change_length)) : change;
    if (std::isfinite(limits.jerk)) jerk_ = (acceleration_ - before) / kTickS;
    velocity_ += kTickS * acceleration_;
  }

  const Vec<N>& velocity() const noexcept { return velocity_; }
  const Vec<N>& acceleration() const noexcept { return acceleration_; }
  const Vec<N>& jerk() const noexcept { return jerk_; }

 private:
  static constexpr double kNear_per_s = 10.0;  // the last bit of the way is closed like a low pass

  /// Acceleration with which `left` is closed: at constant jerk down to where that would take ever more gain.
  static double closing(double left, double jerk) noexcept {
    if (!std::isfinite(jerk)) return jerk;
    const double near = jerk / (kNear_per_s * kNear_per_s);
    return left > near ? std::sqrt(2.0 * jerk * (left - 0.5 * near)) : kNear_per_s * left;
  }

  Vec<N> velocity_ = Vec<N>::Zero();
  Vec<N> acceleration_ = Vec<N>::Zero();
  Vec<N> jerk_ = Vec<N>::Zero();
};

/// Steady speeds and turns take a share of each wheel's duty; balance gets what is left. Turning is kept
/// before travel.
struct DutyBudget {
  double share = 1e9;         // of a wheel's duty that steady motion may take
  double of_friction = 0.0;   // what friction compensation takes of it
  double per_yaw_rate = 0.0;  // of a wheel's duty, s/rad
  double per_speed = 0.0;     // s/m, in the worst direction

  double allowed_yaw_rate(double asked_rad_s) const noexcept {
    const double limit = std::max(0.0, share - of_friction) / std::max(per_yaw_rate, 1e-12);
    return std::clamp(asked_rad_s, -limit, limit);
  }
  /// Largest speed beside a yaw rate.
  double allowed_speed(double yaw_rate_rad_s) const noexcept {
    const double left = share - of_friction - per_yaw_rate * std::abs(yaw_rate_rad_s);
    return std::max(0.0, left) / std::max(per_speed, 1e-12);
  }
};

}  // namespace equipoise
