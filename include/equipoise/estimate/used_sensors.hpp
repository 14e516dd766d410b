// Which sensors of a robot are used, and how what they say is read. In: Measurement -> out: the same without
// what is faulty. Plain values, RT-safe.
#pragma once

#include <cstdint>
#include <utility>

#include "equipoise/estimate/fault_hypotheses.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

/// Which samples are used, and how they are read.
template <int Wheels>
struct UsedSensors {
  static constexpr double kDrift_rad_s = 0.007;  // in a tick: 0.1 rad/s in a second, as a bias that jumps

  std::uint32_t without_wheels = 0;  // bits
  std::uint32_t backwards = 0;       // of these: wiring, they do not return
  std::uint32_t without_axes = 0;    // of the gyro
  std::uint32_t swapped = 0;         // two axes of it
  double swap_sign = 1.0;            // -1: each reads the other backwards
  int reversed = -1;                 // a wheel that counts backwards
  double mirror_rad = 0.0;           // since it stood there
  bool imu = true;
  bool drifts = false;                           // the gyro's bias
  Vec3 bias_rad_s = Vec3::Zero();                // of the gyro, since it jumped
  Vec<Wheels> offset_rad = Vec<Wheels>::Zero();  // of encoders that came back
  Measurement<Wheels> of(const Measurement<Wheels>& z) const noexcept {
    Measurement<Wheels> s = z;
    s.imu_ok = z.imu_ok && imu;
    s.gyro_B_rad_s = gyro_B_rad_s(z);
    s.wheel_angle_rad += offset_rad;
    if (reversed >= 0) s.wheel_angle_rad(reversed) = 2.0 * mirror_rad - s.wheel_angle_rad(reversed);
    for (std::size_t i = 0; i < 3; ++i)
      s.gyro_axis_ok[i] = z.gyro_axis_ok[i] && (without_axes >> i & 1U) == 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(Wheels); ++i)
      s.wheel_ok[i] = z.wheel_ok[i] && (without_wheels >> i & 1U) == 0;
    return s;
  }
  Vec3 gyro_B_rad_s(const Measurement<Wheels>& z) const noexcept {
    Vec3 gyro = z.gyro_B_rad_s - bias_rad_s;
    for (int i = 0; i < 3; ++i) {
      const int k = (i + 1) % 3;
      if (swapped != (1U << i | 1U << k)) continue;
      std::swap(gyro(i), gyro(k));
      gyro(i) *= swap_sign;
      gyro(k) *= swap_sign;
    }
    return gyro;
  }
  /// Rows of gyro, wheels, accelerometer.
  bool leaves_out(std::size_t row) const noexcept {
    constexpr std::size_t kAccel = 3 + static_cast<std::size_t>(Wheels);
    if (row >= 3 && row < kAccel) return (without_wheels >> (row - 3) & 1U) != 0;
    return !imu || (row < 3 && (without_axes >> row & 1U) != 0);
  }

  /// Between two ticks.
  template <class Filter>
  void predict(Filter& filter, const Vec<Filter::Model::kInputs>& u) const noexcept {
    filter.predict(u);
    if (drifts) filter.doubt_bias(kDrift_rad_s);
  }

  UsedSensors with_axes(std::uint32_t axes) const noexcept {
    UsedSensors u = *this;
    u.without_axes &= ~axes;
    return u;
  }

  /// Bit per row of kFaultNames: what they are read by.
  std::uint32_t verdicts() const noexcept {
    constexpr auto kHypotheses = fault_hypotheses<Wheels>();
    constexpr auto kRows = fault_rows<Wheels>();
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < kRows.size(); ++i) bits |= (holds(kHypotheses[i]) ? 1U : 0U) << kRows[i];
    return bits;
  }
  bool holds(const FaultHypothesis& h) const noexcept {
    if (h.kind == FaultHypothesis::kWheel) return (without_wheels & ~backwards & h.mask) != 0;
    if (h.kind == FaultHypothesis::kReversed) return (backwards & h.mask) != 0;
    if (h.kind == FaultHypothesis::kAxis) return (without_axes & h.mask) != 0;
    if (h.kind == FaultHypothesis::kSwap) return swapped == h.mask;
    if (h.kind == FaultHypothesis::kDrift) return drifts;
    return h.kind == FaultHypothesis::kBias && !bias_rad_s.isZero(0.0);
  }

  /// It says something of sensors that are used.
  bool leaves_open(const FaultHypothesis& h) const noexcept {
    if (h.kind == FaultHypothesis::kWheel) return (backwards & h.mask) == 0;
    if (h.kind == FaultHypothesis::kSwap) return ((without_axes | swapped) & h.mask) == 0;
    const bool encoders = h.kind == FaultHypothesis::kReversed || h.kind == FaultHypothesis::kWheels;
    return !encoders || (without_wheels & h.mask) == 0;
  }

  /// A hypothesis turns over what is used of its sensors: an excluded one may be healthy again, a bias
  /// steady.
  UsedSensors turned_over(const FaultHypothesis& h) const noexcept {
    UsedSensors u = *this;
    if (h.kind == FaultHypothesis::kWheel) u.without_wheels ^= h.mask;
    if (h.kind == FaultHypothesis::kWheels) u.without_wheels |= h.mask;
    if (h.kind == FaultHypothesis::kReversed) u.reversed = h.first();
    if (h.kind == FaultHypothesis::kAxis) u.without_axes ^= h.mask;
    if (h.kind == FaultHypothesis::kRock) u.without_axes |= h.mask;
    if (h.kind == FaultHypothesis::kSwap) u.swapped = h.mask;
    if (h.kind == FaultHypothesis::kImu) u.imu = false;
    if (h.kind == FaultHypothesis::kDrift) u.drifts = !drifts;
    return u;
  }
};

}  // namespace equipoise
