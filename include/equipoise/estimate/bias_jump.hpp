// Has the gyro's bias jumped? A jump is there from one sample to the next, stays, and neither the model nor
// the wheels know of it; torque, pushes and friction that lets go make rates grow, and the accelerometer
// feels a knock. In, tick by tick: gyro, how far it jumped against the rates expected, what the wheels say
// the rates have changed by, how much the accelerometer surprises -> out: whether the gyro is under
// examination, so that the filter does without it, and what its bias has jumped by. Rates in rad/s, body
// axes. Limits: chosen on robots 1 to 80 and 7051 to 7100 of the population, standing, turning and driving,
// sound and with 0.2 rad/s on every axis. RT-safe.
#pragma once

#include <algorithm>

#include "equipoise/types.hpp"

namespace equipoise {

class BiasJump {
 public:
  static constexpr int kTicks = 4;  // of an examination
  static constexpr int kMean = 3;   // the last of them, whose mean is compared
  /// What was taken off may have been the end of a lie that the filter had followed: it finds the bias anew.
  static constexpr double kDoubt_rad_s = 0.1;
  static constexpr double kFoundAnew_rad_s = 0.4;  // and may find it so far away

  bool examining() const noexcept { return ticks_ > 0; }

  /// In every tick while it is examining; else where `jump` is large enough. `before`: the gyro a tick ago.
  /// `sigma`: of what wheels and gyro disagree about. `by_wheels()`: change of the rates between the kMean
  /// ticks before the jump and the latest kMean ones. True: this sample is under examination.
  template <class ByWheels>
  bool examine(const Vec3& gyro, const Vec3& before, const Vec3& jump, const Vec3& sigma,
               ByWheels&& by_wheels) noexcept {
    if (!examining()) {
      const double size = jump.squaredNorm();
      const bool begins =
          size < kMost_rad_s * kMost_rad_s && (gyro - before - jump).squaredNorm() < kUnexpected * size;
      if (!begins) return false;
      jump_ = jump;
      before_ = before;
      sum_.setZero();
      surprise_ = 0.0;
    }
    ++ticks_;
    if (ticks_ > kTicks - kMean) sum_ += gyro;
    if (ticks_ < kTicks) return true;
    const bool jumped = surprise_ < kKnock && explains(gyro, sigma, by_wheels());
    drop();
    if (!jumped) return false;
    bias_ += jump_;
    ++jumps_;
    return true;
  }

  /// Without samples nothing comes of an examination.
  void drop() noexcept { ticks_ = 0; }

  /// Normalised innovation of the accelerometer in this tick.
  void feel(double accel_nis) noexcept { surprise_ += accel_nis; }

  const Vec3& bias_rad_s() const noexcept { return bias_; }
  int jumps() const noexcept { return jumps_; }

 private:
  static constexpr double kMost_rad_s = 0.7;    // more is something else
  static constexpr double kUnexpected = 0.16;   // of it, squared, may have been expected
  static constexpr double kKnock = 60.0;        // squared, in sigmas, sum over the ticks
  static constexpr double kStays = 0.02;        // of the jump, squared, it may have changed by since
  static constexpr double kGrows = 0.8;         // of it, in its direction, since
  static constexpr double kExplained = 0.4;     // of what the wheels do not explain, squared, may be left
  static constexpr double kMostLeft = 15.0;     // squared, in sigmas
  static constexpr double kUnexplained = 16.0;  // without the jump, likewise

  /// Do the wheels leave it unexplained, and did it stay, but for what they explain?
  bool explains(const Vec3& gyro, const Vec3& sigma, const Vec3& by_wheels) const noexcept {
    const Vec3 own = sum_ / kMean - before_ - by_wheels;
    const double without = own.cwiseQuotient(sigma).squaredNorm();
    const double left = (own - jump_).cwiseQuotient(sigma).squaredNorm();
    const Vec3 since = gyro - before_ - jump_;
    const double size = jump_.squaredNorm();
    const bool stays = since.squaredNorm() < kStays * size;
    const bool explained =
        left < std::min(kExplained * without, kMostLeft) && since.dot(jump_) < kGrows * size;
    return without > kUnexplained && (stays || explained);
  }

  Vec3 bias_ = Vec3::Zero();
  Vec3 jump_ = Vec3::Zero();
  Vec3 before_ = Vec3::Zero();  // the gyro
  Vec3 sum_ = Vec3::Zero();
  double surprise_ = 0.0;
  int ticks_ = 0;  // of this examination; 0: there is none
  int jumps_ = 0;
};

}  // namespace equipoise
