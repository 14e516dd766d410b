// Whether a sample is news. In: RawSample -> out: flags of what may be used of it.
// A time stamp that does not advance is a duplicate; an IMU, which is noisy, that reports the same numbers
// several times is stuck; an encoder that moves further than its wheel can turn has jumped. RT-safe.
#pragma once

#include <algorithm>
#include <iterator>

#include "equipoise/samples.hpp"

namespace equipoise {

struct FreshnessParams {
  int max_identical_samples = 3;     // 0: not checked
  int max_missed_samples = 2;        // more lost between two samples is a gap
  double max_counts_per_tick = 1e9;  // of an encoder
};

struct Fresh {
  bool imu = false;
  bool imu_gap = false;
  bool attitude = false;
  bool encoder_jump = false;
};

class Freshness {
 public:
  explicit Freshness(const FreshnessParams& params) : p_(params) {}

  Fresh update(const RawSample& raw) noexcept {
    Fresh fresh;
    const double dt_s = 1e-9 * static_cast<double>(raw.t_ns - last_.t_ns);
    const bool same =
        equal(raw.gyro_counts, last_.gyro_counts) && equal(raw.accel_counts, last_.accel_counts);
    identical_ = primed_ && imu_ok(raw) && same ? identical_ + 1 : 0;
    const bool stuck = p_.max_identical_samples > 0 && identical_ >= p_.max_identical_samples;
    fresh.imu = imu_ok(raw) && !stuck && (!primed_ || dt_s > 0.0);
    fresh.imu_gap = primed_ && dt_s > (p_.max_missed_samples + 1.5) * kTickS;
    fresh.attitude = attitude_ok(raw) && (!primed_ || dt_s > 0.0);
    if (primed_ && encoders_ok(raw) && encoders_known_) {
      for (std::size_t i = 0; i < encoders_.size(); ++i) {
        const double moved = raw.encoder_counts[i] - encoders_[i];
        fresh.encoder_jump =
            fresh.encoder_jump || std::abs(moved) > p_.max_counts_per_tick * (1 + encoders_missed_);
      }
    }
    encoders_missed_ = encoders_ok(raw) ? 0 : encoders_missed_ + 1;
    if (encoders_ok(raw)) {
      std::copy(std::begin(raw.encoder_counts), std::end(raw.encoder_counts), encoders_.begin());
      encoders_known_ = true;
    }
    last_ = raw;
    primed_ = true;
    return fresh;
  }

 private:
  template <std::size_t N>
  static bool equal(const double (&a)[N], const double (&b)[N]) noexcept {
    return std::equal(std::begin(a), std::end(a), std::begin(b));
  }

  FreshnessParams p_;
  RawSample last_{};
  std::array<double, kMaxMotors> encoders_{};
  bool primed_ = false;
  bool encoders_known_ = false;
  int encoders_missed_ = 0;
  int identical_ = 0;
};

}  // namespace equipoise
