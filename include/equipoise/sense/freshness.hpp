// What of a sample may be used. In: RawSample, the loop's clock, how far the wheels should have turned ->
// out: the sample without what is old, repeated, impossible or not a number, and how many ticks it ends. A
// value that cannot be used is replaced by the last one that could, with its `valid` bit clear; an encoder
// that jumps further than its wheel can turn counts on from where the model has it. Times are compared in
// whole microseconds, as a log keeps them, so that replay decides alike. RT-safe.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>

#include "equipoise/samples.hpp"

namespace equipoise {

struct FreshnessParams {
  int max_identical_samples = 3;     // of the IMU, which is noisy; 0: not checked
  double max_counts_per_tick = 1e9;  // of an encoder
};

/// The part of a sample that may be used.
struct Fresh {
  RawSample raw{};
  int ticks = 1;                                       // since the last sample
  bool encoder_jump = false;                           // more often than may be
  std::array<bool, 3> gyro_axis_ok{true, true, true};  // sensor axes: its count moves
  bool accel_frozen = false;                           // its counts stand still
};

class Freshness {
 public:
  using Counts = std::array<double, kMaxMotors>;
  static constexpr int kMaxTicks = 20;  // of a gap: beyond, its length does not matter

  explicit Freshness(const FreshnessParams& params) : p_(params) {}

  /// `moved`: counts per tick that the model expects.
  Fresh update(const RawSample& raw, std::int64_t now_ns, const Counts& moved) noexcept {
    Fresh fresh;
    fresh.raw = raw;
    if (is_again(raw)) reject(&fresh.raw, RIO_IMU | RIO_ENCODERS);
    fresh.ticks = ticks_since(now_ns);
    imu(&fresh.raw, now_ns);
    for (std::size_t i = 0; i < 3; ++i) fresh.gyro_axis_ok[i] = still_[i] < kStill;
    fresh.accel_frozen = accel_still_ >= kFrozen;
    fresh.encoder_jump = encoders(&fresh.raw, fresh.ticks, moved);
    if (!std::isfinite(fresh.raw.battery_counts)) reject(&fresh.raw, RIO_BATTERY);
    if (!battery_ok(fresh.raw)) fresh.raw.battery_counts = last_.battery_counts;
    if (!finite(fresh.raw.attitude_wxyz)) reject(&fresh.raw, RIO_ATTITUDE);
    if (!attitude_ok(fresh.raw)) copy(last_.attitude_wxyz, fresh.raw.attitude_wxyz);
    last_ = fresh.raw;
    return fresh;
  }

 private:
  static constexpr std::int64_t kTick_ns = 5'000'000;
  static constexpr std::int64_t kNewClock_ns = 500'000'000;  // a step of the time stamps, not an old sample
  static constexpr std::int64_t kLate_ns = 7'000'000;        // older than a tick and its jitter
  // A noise of 1.4 counts repeats a count six times in a row once in 4000 ticks, of a robot that stands quite
  // still.
  static constexpr int kStill = 6;
  static constexpr int kFrozen = 10;
  static constexpr int kForget = 200;  // ticks without a jump after which one is forgotten
  static constexpr int kMaxJumps = 3;

  template <std::size_t N>
  static bool equal(const double (&a)[N], const double (&b)[N]) noexcept {
    return std::equal(std::begin(a), std::end(a), std::begin(b));
  }
  template <std::size_t N>
  static bool finite(const double (&a)[N]) noexcept {
    double none = 0.0;  // what is not finite leaves NaN
    for (const double v : a) none += v - v;
    return none == 0.0;
  }
  template <std::size_t N>
  static void copy(const double (&from)[N], double (&to)[N]) noexcept {
    std::copy(std::begin(from), std::end(from), std::begin(to));
  }
  static void reject(RawSample* raw, unsigned bit) noexcept { raw->valid &= ~bit; }
  static std::int64_t whole_us(std::int64_t ns) noexcept { return ns / 1000 * 1000; }

  /// The whole sample as it was, with its stamp: the last one once more. Encoders do not move in it, and
  /// nobody knows whether the wheels did.
  bool is_again(const RawSample& raw) noexcept {
    const bool again = primed_ && p_.max_identical_samples > 0 && imu_ok(raw) && raw.t_ns == read_.t_ns &&
                       equal(raw.gyro_counts, read_.gyro_counts) &&
                       equal(raw.accel_counts, read_.accel_counts) &&
                       equal(raw.encoder_counts, read_.encoder_counts);
    read_ = raw;
    return again;
  }

  int ticks_since(std::int64_t now_ns) noexcept {
    const std::int64_t now = whole_us(now_ns);
    const std::int64_t ticks = primed_ ? (now - now_ns_ + kTick_ns / 2) / kTick_ns : 1;
    now_ns_ = now;
    primed_ = true;
    return static_cast<int>(std::clamp<std::int64_t>(ticks, 1, kMaxTicks));
  }

  void imu(RawSample* raw, std::int64_t now_ns) noexcept {
    if (!finite(raw->gyro_counts) || !finite(raw->accel_counts)) reject(raw, RIO_IMU);
    if (imu_ok(*raw)) {
      const bool same = imu_known_ && equal(raw->gyro_counts, last_.gyro_counts) &&
                        equal(raw->accel_counts, last_.accel_counts);
      identical_ = same ? identical_ + 1 : 0;
      const bool stuck = p_.max_identical_samples > 0 && identical_ >= p_.max_identical_samples;
      if (stuck || !is_new(raw->t_ns, whole_us(now_ns))) reject(raw, RIO_IMU);
      if (imu_ok(*raw) && p_.max_identical_samples > 0) count_still(*raw);
    }
    if (!imu_ok(*raw)) {
      copy(last_.gyro_counts, raw->gyro_counts);
      copy(last_.accel_counts, raw->accel_counts);
    }
    imu_known_ = imu_known_ || imu_ok(*raw);
  }

  void count_still(const RawSample& raw) noexcept {
    for (std::size_t i = 0; i < 3; ++i)
      still_[i] = imu_known_ && raw.gyro_counts[i] == last_.gyro_counts[i] ? still_[i] + 1 : 0;
    accel_still_ = imu_known_ && equal(raw.accel_counts, last_.accel_counts) ? accel_still_ + 1 : 0;
  }

  /// By the stamp: later than the last one, and not older than it usually is.
  bool is_new(std::int64_t t_ns, std::int64_t now_ns) noexcept {
    const std::int64_t age = now_ns - t_ns;
    const std::int64_t later = age - age_ns_;  // than usual
    const bool new_clock = !imu_known_ || std::abs(later) > kNewClock_ns;
    const bool advances = new_clock || t_ns > stamp_ns_;
    stamp_ns_ = t_ns;
    if (new_clock || later < 0) age_ns_ = age;
    return advances && (new_clock || later <= kLate_ns);
  }

  bool encoders(RawSample* raw, int ticks, const Counts& moved) noexcept {
    unread_ticks_ += ticks;
    if (!finite(raw->encoder_counts)) reject(raw, RIO_ENCODERS);
    for (std::size_t i = 0; i < moved.size(); ++i) {
      const double expected = unread_ticks_ * moved[i];
      if (!encoders_ok(*raw)) {
        raw->encoder_counts[i] = counts_[i] + offset_[i] + expected;
        continue;
      }
      const double step = raw->encoder_counts[i] - counts_[i];
      if (encoders_known_ && std::abs(step) > p_.max_counts_per_tick * unread_ticks_) {
        offset_[i] += expected - step;
        jumps_ += kForget;
      }
      counts_[i] = raw->encoder_counts[i];
      raw->encoder_counts[i] += offset_[i];
    }
    if (encoders_ok(*raw)) {
      encoders_known_ = true;
      unread_ticks_ = 0;
    }
    jumps_ = std::clamp(jumps_ - 1, 0, 2 * kMaxJumps * kForget);
    return jumps_ > kMaxJumps * kForget;
  }

  FreshnessParams p_;
  RawSample last_{};  // that could be used
  RawSample read_{};
  bool primed_ = false;
  std::int64_t now_ns_ = 0;
  bool imu_known_ = false;
  int identical_ = 0;
  std::array<int, 3> still_{};  // samples for which an axis has repeated its count
  int accel_still_ = 0;
  std::int64_t stamp_ns_ = 0;
  std::int64_t age_ns_ = 0;  // of a sample when the loop wakes
  bool encoders_known_ = false;
  int unread_ticks_ = 0;
  Counts counts_{};  // as the encoders have them
  Counts offset_{};
  int jumps_ = 0;
};

}  // namespace equipoise
