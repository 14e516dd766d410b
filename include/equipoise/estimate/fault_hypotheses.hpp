// What may be wrong with a robot's sensors, as one table, and what only looks like it. In: number of wheels
// -> out: the hypotheses. Plain values, RT-safe.
#pragma once

#include <array>
#include <cstdint>

namespace equipoise {

struct FaultHypothesis {
  enum Kind {
    kWheel,     // an encoder
    kReversed,  // an encoder counts backwards
    kWheels,    // two encoders
    kAxis,      // an axis of the gyro
    kSwap,      // two axes of the gyro exchanged
    kBias,      // the gyro's bias has jumped
    kImu,       // gyro and accelerometer
    kSpin,      // no fault: the ball has spun on the floor
    kSlip,      // no fault: wheels have slipped
    kPush,      // no fault: something has pushed the body
    kNoise      // no fault: the IMU shakes more than lately
  } kind = kWheel;
  std::uint32_t mask = 0;  // of its wheels or axes
  constexpr int first() const noexcept {
    int i = 0;
    while (i < 31 && (mask >> i & 1U) == 0) ++i;
    return i;
  }
  constexpr int last() const noexcept {
    int i = 31;
    while (i > 0 && (mask >> i & 1U) == 0) --i;
    return i;
  }
  constexpr bool healthy() const noexcept {
    return kind == kSpin || kind == kSlip || kind == kPush || kind == kNoise;
  }
  constexpr bool wiring() const noexcept { return kind == kReversed || kind == kSwap; }
};

template <int Wheels>
constexpr auto fault_hypotheses() noexcept {
  constexpr int kPairs = Wheels * (Wheels - 1) / 2;
  std::array<FaultHypothesis, static_cast<std::size_t>(2 * Wheels + kPairs + 3 + 3 + 6)> all{};
  std::size_t n = 0;
  for (int i = 0; i < Wheels; ++i) all[n++] = {FaultHypothesis::kWheel, 1U << i};
  for (int i = 0; i < Wheels; ++i) all[n++] = {FaultHypothesis::kReversed, 1U << i};
  for (int i = 0; i < Wheels; ++i) {
    for (int k = i + 1; k < Wheels; ++k) all[n++] = {FaultHypothesis::kWheels, 1U << i | 1U << k};
  }
  for (int i = 0; i < 3; ++i) all[n++] = {FaultHypothesis::kAxis, 1U << i};
  for (int i = 0; i < 3; ++i) all[n++] = {FaultHypothesis::kSwap, 1U << i | 1U << (i + 1) % 3};
  all[n++] = {FaultHypothesis::kBias, 0};
  all[n++] = {FaultHypothesis::kImu, 0};
  all[n++] = {FaultHypothesis::kSpin, 0};
  all[n++] = {FaultHypothesis::kSlip, 0};
  all[n++] = {FaultHypothesis::kPush, 0};
  all[n++] = {FaultHypothesis::kNoise, 0};
  return all;
}

}  // namespace equipoise
