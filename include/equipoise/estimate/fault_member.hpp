// A hypothesis with its filter: how the samples are read if it holds, what it allows the body to do, and how
// much likelier it is than what is used. In: sample -> out: innovations, and the correction when it is
// needed. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "equipoise/estimate/fault_hypotheses.hpp"
#include "equipoise/estimate/used_sensors.hpp"

namespace equipoise {

/// How noisy a filter is told that its samples are: at least as the control's that it is made of.
template <class Filter, int Wheels>
class SampleNoise {
 public:
  explicit SampleNoise(const Filter& quiet) noexcept {
    for (std::size_t i = 0; i < quiet_.size(); ++i) quiet_[i] = quiet.row_noise(i);
  }
  /// The gyro, by one sigma for all axes, at least by each one's.
  void vibrate(Filter& filter, double sigma_rad_s,
               const std::array<double, 3>& least_rad_s = {}) const noexcept {
    for (std::size_t i = 0; i < 3; ++i) {
      const double sigma = std::max(sigma_rad_s, least_rad_s[i]);
      filter.set_row_noise(i, std::max(quiet_[i], sigma * sigma));
    }
  }
  /// Gyro and accelerometer.
  void shake(Filter& filter, double gyro_rad_s, double accel_m_s2) const noexcept {
    vibrate(filter, gyro_rad_s);
    for (std::size_t i = Filter::Model::kWheel + Wheels; i < quiet_.size(); ++i)
      filter.set_row_noise(i, std::max(quiet_[i], accel_m_s2 * accel_m_s2));
  }

 private:
  std::array<double, Filter::Model::kOutputs> quiet_{};  // variances
};

template <class Filter, int Wheels>
struct FaultMember {
  static constexpr double kPush_N = 1.0;     // of pushes of 0.5 to 4 N, one sigma in a tick
  static constexpr double kSlip_rad = 0.01;  // in a tick: a ball that spins at 2 rad/s on a sill

  static constexpr double kNoise_rad_s = 0.15;  // of an IMU that shakes: real robots that roll reach 0.1
  static constexpr double kNoise_m_s2 = 3.0;    // and 3
  static constexpr double kTooFar_rad = 0.6;    // that a robot tilts: its limit

  Filter filter;
  bool owes = false;   // its correction, which a refuted hypothesis never needs
  bool apart = false;  // it may know more than the filter that uses every sensor
  UsedSensors<Wheels> used{};
  double ratio = 0.0;       // log-likelihood, of the hypothesis over what is used, since it was last refuted
  int since = 0;            // tick: it gains
  bool from_start = false;  // not refuted since arming
  int returns = -1;         // row of an excluded sensor that may be healthy again
  double from = 0.0;        // what that read when the member began

  template <class Sample>
  void innovate(const Sample& z) noexcept {
    owes = z.imu_ok || z.encoders_ok;
    if (owes) return filter.innovate(z);
    filter.update(z);
  }
  Filter& settled() noexcept {
    if (std::exchange(owes, false)) filter.correct();
    return filter;
  }
  /// If it is true, the body tilts by too much within `ticks` more than a control believes.
  bool is_urgent(const Vec3& believed_rad_s, int ticks) noexcept {
    const Vec2 turns = body_rates(settled().estimate()).template head<2>();
    const Vec2 believed = believed_rad_s.head<2>();
    const bool backwards = turns.dot(believed) < 0.0;  // the control does the opposite of what is needed
    const double unseen_rad_s = backwards ? (turns - believed).norm() : turns.norm() - believed.norm();
    return ticks * kTickS * unseen_rad_s > kTooFar_rad;
  }
  /// What is used goes on from elsewhere, which explains `nats` of what this does.
  void depart(double nats, double least) noexcept {
    ratio = std::max(ratio - nats, least);
    apart = true;
  }
  /// Its filter need not run: the tick refutes it down to `least` without, or it would begin `anew`, from
  /// `healthy`, with a loss, and says no less if it begins later. What is as expected is no event.
  template <class Evidence, class Sample>
  bool is_needless(const FaultHypothesis& h, const Evidence& weigh, const Filter& healthy, const Sample& all,
                   const Sample& z, bool anew, double as_used, double least) const noexcept {
    const double so_far = anew ? 0.0 : ratio;
    if (h.happens() && !(so_far > 0.0) && !weigh.surprises()) return true;
    const double then = so_far + most(h, weigh, healthy, all, z, anew) - as_used;
    return anew ? then <= 0.0 : then <= least && !apart;
  }
  /// What a tick says for it at most.
  template <class Evidence, class Sample>
  double most(const FaultHypothesis& h, const Evidence& weigh, const Filter& healthy, const Sample& all,
              const Sample& z, bool anew) const noexcept {
    if (h.kind == FaultHypothesis::kNoise) return weigh.most(all, kNoise_rad_s, kNoise_m_s2);
    if (h.kind == FaultHypothesis::kSwap && anew)
      return weigh.most(healthy, all, static_cast<std::size_t>(h.first()), used.gyro_B_rad_s(z)(h.first()));
    return h.leaves_out() ? weigh.most(all, used, z) : Evidence::kOutlier;
  }
  void refute(double to) noexcept {
    ratio = to;
    owes = false;
  }
  void allow(const FaultHypothesis& h) noexcept {
    if (h.pushes()) filter.allow_push(kPush_N);
    if (h.kind == FaultHypothesis::kSpin) filter.allow_spin(kSlip_rad);
    if (h.kind == FaultHypothesis::kSlip || h.kind == FaultHypothesis::kRock) filter.allow_slip(kSlip_rad);
    if constexpr (kRocksOn<Wheels>) {
      if (h.kind == FaultHypothesis::kRock) filter.allow_hit(kPush_N);
    }
  }
  /// `event` is over and explains what was, against faults that would, too.
  void keep(FaultMember& event) noexcept {
    if (!(event.ratio > std::max(ratio, 0.0))) return;
    filter.adopt(event.settled());
    owes = false;
    used = event.used;
    ratio = event.ratio;
  }
};

}  // namespace equipoise
