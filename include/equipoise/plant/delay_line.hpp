// The recent past of what the sensors feel, so that each may report its own age of it.
// In: motion at growing instants -> out: gyro, specific force, wheel angles at an earlier one, linear between
// records. Before the first: the first. Simulation only; allocates nothing.
#pragma once

#include <algorithm>
#include <array>

#include "equipoise/samples.hpp"

namespace equipoise {

/// What gyro, accelerometer and encoders feel at one instant.
struct Felt {
  double time_s = 0.0;
  Vec3 omega_B_rad_s = Vec3::Zero();
  Vec3 specific_force_B_m_s2 = Vec3::Zero();                  // at the IMU
  Vec<kMaxMotors> wheel_angle_rad = Vec<kMaxMotors>::Zero();  // relative to the body
};

class DelayLine {
 public:
  static constexpr double kSameTime_s = 1e-9;
  static constexpr double kSpacing_s = 0.5e-3;  // of the records that are kept
  static constexpr std::size_t kRecords = 160;  // 80 ms: the slowest low pass and its spread

  void add(const Felt& felt) noexcept {
    const bool again = count_ >= 1 && felt.time_s - at(0).time_s < kSameTime_s;
    const bool dense = count_ >= 2 && at(0).time_s - at(1).time_s < kSpacing_s;
    if (again || dense) --count_;
    records_[count_ % kRecords] = felt;
    ++count_;
  }

  /// Linear between the records around `time_s`.
  template <class Field>
  auto value(double time_s, Field field) const noexcept -> std::decay_t<decltype(Felt{}.*field)> {
    const std::size_t kept = std::min(count_, kRecords);
    for (std::size_t back = 0; back + 1 < kept; ++back) {
      const Felt& newer = at(back);
      const Felt& older = at(back + 1);
      if (time_s < older.time_s) continue;
      const double share = (time_s - older.time_s) / (newer.time_s - older.time_s);
      return older.*field + std::min(share, 1.0) * (newer.*field - older.*field);
    }
    return at(kept - 1).*field;
  }

 private:
  /// `back` records before the newest.
  const Felt& at(std::size_t back) const noexcept { return records_[(count_ - 1 - back) % kRecords]; }

  std::array<Felt, kRecords> records_{};
  std::size_t count_ = 0;
};

}  // namespace equipoise
