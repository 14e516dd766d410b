// What may be wrong with a robot's sensors, as one table, and what only looks like it. In: number of wheels
// -> out: the hypotheses; their rows in the table of every robot, whose names all readers show
// (tools/equipoise_tools/names.py). Plain values, RT-safe.
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
    kDrift,     // the gyro's bias drifts
    kImu,       // gyro and accelerometer
    kSpin,      // no fault: the ball has spun on the floor
    kSlip,      // no fault: wheels have slipped
    kPush,      // no fault: something has pushed the body
    kNoise,     // no fault: the IMU shakes more than lately
    kRock,      // no fault: a wheel was hit, a robot on two of them rocks
    kEvent      // no fault: one of these was lately
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
  constexpr bool healthy() const noexcept { return kind >= kSpin; }
  constexpr bool of_imu() const noexcept { return kind >= kAxis && !healthy(); }
  constexpr bool pushes() const noexcept { return kind == kPush || kind == kRock; }
  constexpr bool happens() const noexcept { return kind == kSpin || kind == kSlip || kind == kPush; }
  constexpr bool waits() const noexcept { return kind == kBias || kind == kEvent; }  // to be begun
  constexpr bool leaves_out() const noexcept {
    return kind == kWheel || kind == kWheels || kind == kAxis || kind == kImu || kind == kRock;
  }
  /// What is broken stays so; a blow or a slip that looks like it does not. `stops`: swapped, it falls
  /// before.
  constexpr bool lasts(bool stops) const noexcept {
    return kind <= kWheels || kind == (stops ? kAxis : kBias);
  }
  constexpr bool wiring() const noexcept { return kind == kReversed || kind == kSwap; }
};

/// A robot on two wheels rocks about y, the axis ahead, whose gyro then tells of the floor.
template <int Wheels>
inline constexpr bool kRocksOn = Wheels == 2;

template <int Wheels, bool Rocks = kRocksOn<Wheels>>
constexpr auto fault_hypotheses() noexcept {
  constexpr int kPairs = Wheels * (Wheels - 1) / 2;
  std::array<FaultHypothesis, static_cast<std::size_t>(2 * Wheels + kPairs + 3 + 3 + (Rocks ? 9 : 7))> all{};
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
  if (Rocks) {
    all[n++] = {FaultHypothesis::kRock, 1U << 1};
    all[n++] = {FaultHypothesis::kEvent, 0};
  }
  all[n++] = {FaultHypothesis::kDrift, 0};
  return all;
}

/// Of a kind that a robot has but once.
template <int Wheels>
constexpr std::size_t fault_index(FaultHypothesis::Kind kind) noexcept {
  constexpr auto kAll = fault_hypotheses<Wheels>();
  std::size_t i = 0;
  while (kAll[i].kind != kind) ++i;
  return i;
}

/// Everybody's bits on the wire.
inline constexpr std::array<const char*, fault_hypotheses<4, true>().size()> kFaultNames{
    // of a robot with four wheels
    "encoder_1",
    "encoder_2",
    "encoder_3",
    "encoder_4",
    "encoder_1_reversed",
    "encoder_2_reversed",
    "encoder_3_reversed",
    "encoder_4_reversed",
    "encoders_1_2",
    "encoders_1_3",
    "encoders_1_4",
    "encoders_2_3",
    "encoders_2_4",
    "encoders_3_4",
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "gyro_x_y_swapped",
    "gyro_y_z_swapped",
    "gyro_z_x_swapped",
    "gyro_bias",
    "imu",
    "spin",
    "slip",
    "push",
    "imu_noise",
    "rock",
    "event",
    "gyro_drift"};
static_assert(kFaultNames.size() <= 32, "FaultEvidence::verdicts has a bit for each");

/// Of each hypothesis of a robot its row among kFaultNames.
template <int Wheels>
constexpr auto fault_rows() noexcept {
  constexpr auto kAll = fault_hypotheses<4, true>();
  constexpr auto kOwn = fault_hypotheses<Wheels>();
  std::array<std::int32_t, kOwn.size()> rows{};
  for (std::size_t i = 0; i < kOwn.size(); ++i) {
    while (kAll[static_cast<std::size_t>(rows[i])].kind != kOwn[i].kind ||
           kAll[static_cast<std::size_t>(rows[i])].mask != kOwn[i].mask)
      ++rows[i];
  }
  return rows;
}

/// What was weighed in a tick. Ratios are log-likelihoods over what is used, less what is rarer than others,
/// in nats.
struct FaultEvidence {
  std::int32_t leading = -1;  // row of kFaultNames; -1: none
  double ratio = 0.0;
  double bound = 0.0;           // 0: no hypothesis is weighed in this run
  std::int32_t runner_up = -1;  // among those with another consequence; -1: that all is well
  double runner_up_ratio = 0.0;
  bool decided = false;        // in this tick: a verdict is taken, or taken back
  std::uint32_t verdicts = 0;  // bit per row: what is held to be faulty; of a disarmed robot, what was
};

}  // namespace equipoise
