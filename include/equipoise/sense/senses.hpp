// What the tick senses. In: RawSample, the loop's clock, wheel rates of the model -> out: Measurement: SI,
// body axes, wheel rates, attitude, and what of it is news. Joins calibration, freshness, rotor speed and,
// where configured, our own attitude in place of the packets. RT-safe.
#pragma once

#include "equipoise/sense/attitude_filter.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "equipoise/sense/freshness.hpp"
#include "equipoise/sense/rotor_speed.hpp"

namespace equipoise {

template <int Wheels>
class Senses {
 public:
  Senses(const Calibration& calibration, const FreshnessParams& freshness,
         const AttitudeFilterParams& attitude)
      : calibration_(calibration), freshness_(freshness), attitude_(attitude), own_attitude_(attitude.own) {}

  /// `rate_rad_s`: of the wheels, as expected; carries them on where encoders are missing or jump.
  /// `attitude`: somebody reads its angles.
  Measurement<Wheels> update(const RawSample& raw, std::int64_t now_ns, const Vec<Wheels>& rate_rad_s,
                             bool attitude = true) noexcept {
    const Fresh fresh = freshness_.update(raw, now_ns, counts_per_tick(rate_rad_s));
    Measurement<Wheels> z = calibrate<Wheels>(fresh.raw, calibration_, attitude && !own_attitude_);
    z.ticks = fresh.ticks;
    z.encoder_jump = fresh.encoder_jump;
    z.accel_frozen = fresh.accel_frozen;
    if (fresh.gyro_axis_ok != all_true<3>()) z.gyro_axis_ok = body_axes(fresh.gyro_axis_ok);
    z.bridge_fault = (raw.health & RIO_BRIDGE_FAULT) != 0;
    z.wheel_rate_rad_s = rotor_speed_.update(z.wheel_angle_rad, z.ticks);
    if (own_attitude_) apply(attitude_, z);
    return z;
  }

 private:
  static constexpr double kReads = 0.1;  // share of a sensor's axis in a body's

  /// Body axes of which no sensor axis is lost.
  std::array<bool, 3> body_axes(const std::array<bool, 3>& sensor_ok) const noexcept {
    std::array<bool, 3> ok = all_true<3>();
    for (int body = 0; body < 3; ++body) {
      for (int sensor = 0; sensor < 3; ++sensor) {
        if (std::abs(calibration_.R_BS(body, sensor)) > kReads &&
            !sensor_ok[static_cast<std::size_t>(sensor)])
          ok[static_cast<std::size_t>(body)] = false;
      }
    }
    return ok;
  }

  Freshness::Counts counts_per_tick(const Vec<Wheels>& rate_rad_s) const noexcept {
    Freshness::Counts counts{};
    for (int i = 0; i < Wheels; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double turns = std::isfinite(rate_rad_s(i)) ? rate_rad_s(i) * kTickS / (2.0 * kPi) : 0.0;
      counts[k] = calibration_.encoder_sign[k] * calibration_.encoder_counts_per_rev * turns;
    }
    return counts;
  }

  Calibration calibration_;
  Freshness freshness_;
  RotorSpeed<Wheels> rotor_speed_;
  AttitudeFilter attitude_;
  bool own_attitude_;
};

}  // namespace equipoise
