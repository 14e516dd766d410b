// Samples of an IMU that no motion explains: a glitch is not used, nor, when it goes on, the gyro's axes that
// are off; an axis that repeats its counts while the body turns is dead, and not used. In: Measurement, what
// the gyro should read -> out: what may be used, and whether the robot can go on. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "equipoise/estimate/fault_hypotheses.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

class GrossSamples {
 public:
  /// `balances`: axes of the gyro that balance; `slowly_rad_s`: a robot that turns no faster stands without.
  GrossSamples(const std::array<bool, 3>& balances, double slowly_rad_s)
      : balances_(balances), slowly_rad_s_(slowly_rad_s) {}

  void reset() noexcept {
    gross_ = frozen_ = 0;
    trusted_ = stands_ = true;
  }

  template <int Wheels>
  Measurement<Wheels> without(const Measurement<Wheels>& raw, const Vec3& expected_rad_s) noexcept {
    Measurement<Wheels> z = raw;
    const Vec3 away = z.gyro_B_rad_s - expected_rad_s;
    Vec3 explained = away;
    if (kRocksOn<Wheels>) explained.y() = 0.0;  // pushed aside, as fast as it may
    const bool gross = z.imu_ok && !(explained.norm() < kGross_rad_s && z.accel_B_m_s2.norm() < kGross_m_s2);
    gross_ = gross ? gross_ + 1 : 0;
    if (gross && gross_ <= kGlitch) z.imu_ok = false;
    bool frozen = off_ = false;
    double balance_rad_s = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double away_rad_s = std::abs(away(static_cast<int>(i)));
      const bool off = !(away_rad_s < kGross_rad_s);
      off_ = off_ || off;
      z.gyro_axis_ok[i] = z.gyro_axis_ok[i] && !off;
      if (!balances_[i]) continue;
      balance_rad_s = std::max(balance_rad_s, away_rad_s);
      frozen = frozen || (z.imu_ok && !raw.gyro_axis_ok[i] && away_rad_s > kTurns_rad_s);
    }
    frozen_ = frozen ? frozen_ + 1 : 0;
    if (frozen && !(std::abs(expected_rad_s.z()) < slowly_rad_s_)) stands_ = false;
    trusted_ = trusted_ && (stands_ || frozen_ <= kFrozenTicks) &&
               !(gross_ > kGlitch && balance_rad_s > kGross_rad_s);
    return z;
  }

  bool trusted() const noexcept { return trusted_; }
  /// An axis is not used, and for longer than a glitch.
  bool left_out() const noexcept { return frozen_ >= kFrozenTicks || (off_ && gross_ > kGlitch); }

 private:
  static constexpr double kGross_rad_s = 3.0;  // between two samples: 600 rad/s2
  static constexpr double kGross_m_s2 = 4.0 * kGravity_m_s2;
  static constexpr int kGlitch = 3;             // samples in a row; more are not
  static constexpr double kTurns_rad_s = 0.05;  // 50 counts
  static constexpr int kFrozenTicks = 4;

  std::array<bool, 3> balances_;
  double slowly_rad_s_;
  int gross_ = 0;  // ticks in a row
  int frozen_ = 0;
  bool off_ = false;  // an axis of the gyro
  bool trusted_ = true;
  bool stands_ = true;  // it has not turned too fast for an axis that is dead
};

}  // namespace equipoise
