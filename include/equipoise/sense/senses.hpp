// What the tick senses. In: RawSample -> out: Measurement: SI, body axes, wheel rates, attitude, and what of
// it is news. Joins calibration, freshness, rotor speed and, where configured, our own attitude in place of
// the packets. RT-safe.
#pragma once

#include <algorithm>
#include <iterator>

#include "equipoise/sense/attitude_filter.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "equipoise/sense/freshness.hpp"
#include "equipoise/sense/rotor_speed.hpp"

namespace equipoise {

inline bool finite(const RawSample& raw) noexcept {
  const auto all = [](const auto& values) {
    return std::all_of(std::begin(values), std::end(values), [](double v) { return std::isfinite(v); });
  };
  return all(raw.gyro_counts) && all(raw.accel_counts) && all(raw.encoder_counts) && all(raw.attitude_wxyz) &&
         std::isfinite(raw.battery_counts);
}

template <int Wheels>
class Senses {
 public:
  Senses(const Calibration& calibration, const FreshnessParams& freshness,
         const AttitudeFilterParams& attitude)
      : calibration_(calibration), freshness_(freshness), attitude_(attitude), own_attitude_(attitude.own) {}

  Measurement<Wheels> update(const RawSample& raw) noexcept {
    Measurement<Wheels> z = calibrate<Wheels>(raw, calibration_);
    const Fresh fresh = freshness_.update(raw);
    z.imu_ok = fresh.imu;
    z.imu_gap = fresh.imu_gap;
    z.attitude_ok = fresh.attitude;
    z.encoder_jump = fresh.encoder_jump;
    z.bridge_fault = (raw.health & RIO_BRIDGE_FAULT) != 0;
    z.all_finite = finite(raw);
    z.wheel_rate_rad_s = rotor_speed_.update(z.wheel_angle_rad);
    if (own_attitude_) apply(attitude_, z);
    return z;
  }

 private:
  Calibration calibration_;
  Freshness freshness_;
  RotorSpeed<Wheels> rotor_speed_;
  AttitudeFilter attitude_;
  bool own_attitude_;
};

}  // namespace equipoise
