// What gyro and wheels said in the latest ticks. In: a sample per tick -> out: mean and change of the rates,
// and how far the wheels turned meanwhile. Gyro in rad/s, body axes; wheel angles in rad. RT-safe.
#pragma once

#include <algorithm>
#include <array>

#include "equipoise/types.hpp"

namespace equipoise {

/// The latest `Half` ticks and as many before.
template <int Wheels, std::size_t Half>
class GyroHistory {
 public:
  static constexpr std::size_t kSum = 3;  // ticks: sums of so many are kept
  static_assert(Half % kSum == 0);
  static constexpr std::size_t span(std::size_t half) noexcept { return 2 * half + 1; }
  static constexpr std::size_t kKept = span(Half);

  /// The latest ticks, and what changed since as many before.
  struct Span {
    Vec3 mean_rad_s;
    Vec3 change_rad_s;
    Vec<Wheels> turned_rad;
    Vec<Wheels> turned_more_rad;
  };

  void forget() noexcept { samples_ = 0; }
  std::size_t samples() const noexcept { return samples_; }  // at most kKept

  void add(const Vec3& gyro_rad_s, const Vec<Wheels>& wheel_angle_rad) noexcept {
    latest_ = latest_ > 0 ? latest_ - 1 : kKept - 1;
    gyro_[latest_] = gyro_[latest_ + kKept] = gyro_rad_s;
    gyro_sum_[latest_] = gyro_sum_[latest_ + kKept] =
        gyro_[latest_] + gyro_[latest_ + 1] + gyro_[latest_ + 2];
    angle_[latest_] = angle_[latest_ + kKept] = wheel_angle_rad;
    samples_ = std::min(samples_ + 1, kKept);
  }

  const Vec3& gyro_rad_s() const noexcept { return gyro_[latest_]; }

  /// Asks for span(Ticks) samples; Ticks: a multiple of kSum.
  template <std::size_t Ticks>
  Span latest() const noexcept {
    static_assert(Ticks % kSum == 0 && Ticks <= Half);
    const Vec3* const gyro = &gyro_sum_[latest_];
    const Vec<Wheels>* const angle = &angle_[latest_];
    constexpr double share = 1.0 / static_cast<double>(Ticks);
    Vec3 sum = gyro[0];
    Vec3 before = gyro[Ticks];
    for (std::size_t i = kSum; i < Ticks; i += kSum) {
      sum += gyro[i];
      before += gyro[Ticks + i];
    }
    Span s;
    s.mean_rad_s = share * sum;
    s.change_rad_s = share * (sum - before);
    s.turned_rad = angle[0] - angle[Ticks];
    s.turned_more_rad = angle[0] - 2.0 * angle[Ticks] + angle[2 * Ticks];
    return s;
  }

  /// In the `ticks` up to `now`, which follows the latest sample, against those `apart` before.
  Vec<Wheels> turned_more_rad(const Vec<Wheels>& now, std::size_t ticks, std::size_t apart) const noexcept {
    const Vec<Wheels>* const angle = &angle_[latest_];
    return now - angle[ticks - 1] - (angle[apart - 1] - angle[apart + ticks - 1]);
  }

 private:
  // From `latest_` on, latest first; each is written twice, so that none is moved.
  std::array<Vec3, 2 * kKept> gyro_{};
  std::array<Vec3, 2 * kKept> gyro_sum_{};  // of kSum from there on
  std::array<Vec<Wheels>, 2 * kKept> angle_{};
  std::size_t latest_ = 0;
  std::size_t samples_ = 0;
};

}  // namespace equipoise
