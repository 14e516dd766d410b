// Which encoder lies? A bank of filters, each without one wheel, beside the one that uses all; the one that
// leaves out the liar explains the rest. In: input, sample, spin of the wheels against the gyro -> out: which
// wheel, and whether it stands still; the filter goes on without it. The bank runs right after arming and
// under suspicion only. Its limits were chosen on 30 robots of the population, with pushes, stuck and
// reversed wheels. Filter: predict(u), update(z), row_nis(), wheel_rate_rad_s(), Model::kWheel. RT-safe:
// bounded, no allocation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "equipoise/estimate/health.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

template <class Filter, int Wheels>
class WheelIsolation {
 public:
  using Sample = Measurement<Wheels>;
  static constexpr int kArmingTicks = 100;  // after arming the bank runs anyway

  explicit WheelIsolation(const Filter& filter) : bank_(filled(filter, std::make_index_sequence<Wheels>())) {}

  /// Motors off: every wheel is trusted again.
  void reset() noexcept {
    lost_ = -1;
    ticks_ = 0;
    quiet_ = kArmingTicks;
    hits_ = 0;
    slip_ = 0.0;
    still_.fill(0);
    mean_.fill(0.0);
    known_ = false;
    stood_still_ = false;
    running_ = false;
  }

  /// One tick of `filter`, which goes on without a wheel that is found out. `spin(rates)`: what the encoders'
  /// rates say about the spin less what the gyro says, rad/s.
  template <class Input, class Spin>
  void step(Filter& filter, const Input& u, const Sample& z, Spin&& spin) noexcept {
    ++ticks_;
    watch(z, spin);
    Sample used = z;
    if (lost_ >= 0) used.wheel_ok[static_cast<std::size_t>(lost_)] = false;
    if (lost_ < 0 && !running_ && suspicious()) start(filter);
    filter.predict(u);
    filter.update(used);
    if (lost_ >= 0) return;
    follow(mean_[Wheels], filter, -1);
    if (!running_) return;
    for (int i = 0; i < Wheels; ++i) {
      Filter& without = bank_[static_cast<std::size_t>(i)];
      Sample rest = z;
      rest.wheel_ok[static_cast<std::size_t>(i)] = false;
      without.predict(u);
      without.update(rest);
      follow(mean_[static_cast<std::size_t>(i)], without, i);
    }
    judge(filter);
    quiet_ = suspicious() ? kQuietTicks : quiet_ - 1;
    running_ = running_ && quiet_ > 0;
  }

  /// The wheel whose encoder is not used any more; -1: none.
  int lost() const noexcept { return lost_; }
  /// It stood still when it was found out; else it counted wrongly.
  bool stood_still() const noexcept { return stood_still_; }
  /// So soon after arming that the robot had better not run without it.
  bool while_arming() const noexcept { return lost_ >= 0 && lost_at_ <= kArmingTicks; }
  /// Just armed: a lying encoder surprises the estimator before it can be named.
  bool checking() const noexcept { return ticks_ <= kTrialTicks && lost_ < 0; }
  /// Smoothed spin of the wheels against the gyro.
  double slip_rad_s() const noexcept { return slip_; }

 private:
  static constexpr std::size_t kMeans = static_cast<std::size_t>(Wheels) + 1;  // the last: with all wheels
  static constexpr int kFirstTick = 5;
  static constexpr int kTrialTicks = 80;
  static constexpr int kQuietTicks = 100;
  static constexpr int kHits = 3;  // ticks in a row
  static constexpr int kStillTicks = 6;
  static constexpr double kMean = 0.2;  // of the squared innovations: five ticks
  static constexpr double kSlipMean = 0.15;
  static constexpr double kLargest = 100.0;   // one outlier decides nothing
  static constexpr double kSlip_rad_s = 0.3;  // pushes do not enter it
  static constexpr double kSurprised = 2.0;   // mean of the filter with all wheels
  static constexpr double kSuspicious = 1.0;
  static constexpr double kExplains = 0.25;  // of the surprise is left without the wheel
  static constexpr double kExplainsStill = 0.8;
  static constexpr double kTurning_rad_s = 1.5;

  template <std::size_t... I>
  static std::array<Filter, sizeof...(I)> filled(const Filter& filter, std::index_sequence<I...>) {
    return {((void)I, filter)...};
  }

  bool suspicious() const noexcept {
    return ticks_ <= 1 || mean_[Wheels] > kSuspicious || std::abs(slip_) > 0.5 * kSlip_rad_s;
  }

  void start(const Filter& filter) noexcept {
    bank_.fill(filter);
    std::fill(mean_.begin(), mean_.end() - 1, mean_[Wheels]);
    quiet_ = std::max(quiet_, kQuietTicks);
    hits_ = 0;
    running_ = true;
  }

  template <class Spin>
  void watch(const Sample& z, Spin&& spin) noexcept {
    if (!z.encoders_ok || !z.imu_ok) {
      known_ = false;
      return;
    }
    if (known_) {
      const Vec<Wheels> moved = z.wheel_angle_rad - angle_rad_;
      slip_ += kSlipMean * (spin(Vec<Wheels>(moved / kTickS)) - slip_);
      for (int i = 0; i < Wheels; ++i) {
        int& still = still_[static_cast<std::size_t>(i)];
        still = moved(i) == 0.0 ? still + 1 : 0;
      }
    }
    angle_rad_ = z.wheel_angle_rad;
    known_ = true;
  }

  /// Gyro and wheel rows; the accelerometer has no say.
  void follow(double& mean, const Filter& filter, int without) const noexcept {
    double sum = 0.0;
    int rows = 0;
    for (int row = 0; row < Filter::Model::kWheel + Wheels; ++row) {
      if (without >= 0 && row == Filter::Model::kWheel + without) continue;
      sum += std::min(filter.row_nis()[static_cast<std::size_t>(row)], kLargest);
      ++rows;
    }
    mean += kMean * (sum / rows - mean);
  }

  void judge(Filter& filter) noexcept {
    if (ticks_ < kFirstTick) return;
    const double all = mean_[Wheels];
    int best = -1;
    if (std::abs(slip_) > kSlip_rad_s && all > kSurprised) {
      const auto end = mean_.begin() + Wheels;
      const auto least = std::min_element(mean_.begin(), end);
      double second = kLargest;
      for (auto m = mean_.begin(); m != end; ++m) second = m == least ? second : std::min(second, *m);
      if (*least < kExplains * std::min(all, second)) best = static_cast<int>(least - mean_.begin());
      const Vec<Wheels> rate = filter.wheel_rate_rad_s();
      for (int i = 0; i < Wheels && best < 0; ++i) {
        const auto k = static_cast<std::size_t>(i);
        const bool turning = std::abs(rate(i)) > kTurning_rad_s;
        if (still_[k] >= kStillTicks && turning && mean_[k] < kExplainsStill * all) best = i;
      }
    }
    hits_ = best >= 0 ? hits_ + 1 : 0;
    if (hits_ < kHits) return;
    lost_ = best;
    lost_at_ = ticks_;
    stood_still_ = still_[static_cast<std::size_t>(best)] >= kHits;
    filter = bank_[static_cast<std::size_t>(best)];
    running_ = false;
  }

  std::array<Filter, static_cast<std::size_t>(Wheels)> bank_;
  std::array<double, kMeans> mean_{};
  std::array<int, static_cast<std::size_t>(Wheels)> still_{};
  Vec<Wheels> angle_rad_ = Vec<Wheels>::Zero();
  bool known_ = false;
  double slip_ = 0.0;
  int ticks_ = 0;  // since arming
  int quiet_ = kArmingTicks;
  int hits_ = 0;
  int lost_ = -1;
  int lost_at_ = 0;
  bool stood_still_ = false;
  bool running_ = false;
};

template <class Filter, int Wheels>
void report(const WheelIsolation<Filter, Wheels>& isolation, EstimatorHealth<Wheels>* health) noexcept {
  if (isolation.lost() >= 0) health->lost = 1U << isolation.lost();
  health->stood_still = isolation.stood_still();
  health->while_arming = isolation.while_arming();
  health->checking = isolation.checking();
  health->predicts_wheels = true;
}

}  // namespace equipoise
