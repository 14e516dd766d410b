// Gyro bias of a robot that is held still, whatever its size: at rest the rate varies no more than the
// sensor's noise explains. In: body rates -> out: their mean over the last stretch of rest, and whether there
// has been one. A body that is turned begins the stretch anew. RT-safe.
#pragma once

#include <algorithm>
#include <cmath>

#include "equipoise/types.hpp"

namespace equipoise {

class RestBias {
 public:
  Vec3 update(const Vec3& gyro_B_rad_s) noexcept {
    if (!(gyro_B_rad_s.cwiseAbs().maxCoeff() < kRange_rad_s)) {
      samples_ = in_block_ = 0;
      return bias_;
    }
    if (in_block_ == 0) sum_ = roughness_ = Vec3::Zero();
    if (in_block_ > 0) roughness_ += (gyro_B_rad_s - before_).cwiseAbs2();
    before_ = gyro_B_rad_s;
    sum_ += gyro_B_rad_s;
    if (++in_block_ == kBlock) end_block();
    return bias_;
  }

  /// Known from elsewhere, of a robot that moves already.
  void tell(const Vec3& bias_B_rad_s) noexcept {
    bias_ = bias_B_rad_s;
    known_ = true;
  }
  /// Standard deviation of the samples, at rest.
  const Vec3& noise_rad_s() const noexcept { return noise_; }
  /// For two seconds until this sample the robot has stood, and no hand held it: means of an eighth of a
  /// second scatter as the samples' noise lets them.
  bool stands() const noexcept {
    return in_block_ == 0 && samples_ == kWindow &&
           (scatter_.array() < kStands / kBlock * noise_.array().square()).all();
  }
  /// Standard deviation of those means.
  Vec3 scatter_rad_s() const noexcept { return scatter_.cwiseSqrt(); }
  /// The robot has been at rest since power-on: the bias is known.
  bool known() const noexcept { return known_; }

 private:
  static constexpr double kRange_rad_s = 35.0;  // of the sensor, 2000 deg/s; NaN fails, too
  static constexpr int kBlock = 25;    // ticks, 0.125 s: the mean of hand tremor (8 to 12 Hz) vanishes
  static constexpr int kWindow = 400;  // ticks of the stretch that count
  // Times the variance that noise leaves in means: by chance 1 in 1e5 (chi squared, 15 degrees of freedom).
  static constexpr double kStands = 3.0;
  // A bias that is off by this is found in motion (initial_sigma of the filters: 0.005 rad/s, 4 sigma).
  static constexpr double kTurns_rad_s = 0.02;
  static constexpr double kSigmas = 4.0;  // of the means' noise
  // MPU-9250, data sheet: 5 deg/s at 25 degrees C, 0.24 deg/s per K over 25 K. More is a turning body or a
  // fault.
  static constexpr double kLargest_rad_s = (5.0 + 0.24 * 25.0) * kPi / 180.0;
  // Garbage among the samples. Real gyros at rest: 0.0009 to 0.0018 rad/s; a robot tolerates 0.2.
  static constexpr double kRough_rad_s = 0.3;

  void end_block() noexcept {
    in_block_ = 0;
    const Vec3 mean = sum_ / kBlock;
    // Half the mean squared successive difference is the variance of the noise alone (von Neumann 1941).
    const Vec3 noise = (roughness_ / (2.0 * (kBlock - 1))).cwiseSqrt();
    const Vec3 tolerance = Vec3::Constant(kTurns_rad_s) + kSigmas * std::sqrt(2.0 / kBlock) * noise;
    const bool plausible =
        ((mean.cwiseAbs() - tolerance).array() < kLargest_rad_s).all() && noise.maxCoeff() < kRough_rad_s;
    const bool same = ((mean - mean_).cwiseAbs().array() < tolerance.array()).all();
    samples_ = !plausible ? 0 : samples_ > 0 && same ? std::min(samples_ + kBlock, kWindow) : kBlock;
    if (samples_ == kBlock) {
      mean_ = mean;
      scatter_ = Vec3::Zero();
    }
    if (samples_ <= kBlock) return;
    const double share = static_cast<double>(kBlock) / samples_;
    const Vec3 off = mean - mean_;
    mean_ += share * off;
    scatter_ = (1.0 - share) * (scatter_ + share * off.cwiseAbs2());
    bias_ = mean_;
    noise_ = noise;
    known_ = true;
  }

  Vec3 sum_ = Vec3::Zero();        // of the block
  Vec3 roughness_ = Vec3::Zero();  // squared differences from sample to sample
  Vec3 before_ = Vec3::Zero();
  Vec3 mean_ = Vec3::Zero();  // of the stretch
  Vec3 bias_ = Vec3::Zero();
  Vec3 noise_ = Vec3::Zero();
  Vec3 scatter_ = Vec3::Zero();  // variance of the means
  int in_block_ = 0;
  int samples_ = 0;  // in the stretch
  bool known_ = false;
};

}  // namespace equipoise
