// Which encoder lies? A bank of filters, each without one wheel, beside the one that uses all; the one that
// leaves out the liar explains the rest. In: input, sample, spin of the wheels against the gyro -> out: which
// wheel, and whether it stands still; the filter goes on without it. The bank runs right after arming and
// under suspicion only. Where no wheel explains it better than another, the likeliest is left out on trial,
// and another instead as soon as that explains more. Limits were chosen on 30 robots of the population, with
// pushes, stuck and reversed wheels, those of the trial on eduMIPs 7601 to 7750. Filter: predict(u),
// update(z), row_nis(), wheel_rate_rad_s(), Model::kWheel. RT-safe: bounded, no allocation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "equipoise/estimate/health.hpp"
#include "equipoise/samples.hpp"

namespace equipoise {

/// 1 + what a filter has learnt of the wheels' radii, as far as robots as built differ; a lying encoder takes
/// the filter further.
inline double believable_scale(double learnt) noexcept { return 1.0 + std::clamp(learnt, -0.05, 0.05); }

template <class Filter, int Wheels>
class WheelIsolation {
 public:
  using Sample = Measurement<Wheels>;
  static constexpr int kArmingTicks = 100;  // after arming the bank runs anyway

  /// `play_rad`: spin that a motor can turn alone, within its gears.
  explicit WheelIsolation(const Filter& filter, double play_rad = 0.0)
      : bank_(filled(filter, std::make_index_sequence<Wheels>())), play_rad_(play_rad) {}

  /// Motors off: every wheel is trusted again.
  void reset() noexcept {
    lost_ = -1;
    ticks_ = 0;
    quiet_ = kArmingTicks;
    hits_ = 0;
    slip_ = 0.0;
    slipped_rad_ = 0.0;
    still_.fill(0);
    slipped_still_rad_.fill(0.0);
    mean_.fill(0.0);
    known_ = false;
    stood_still_ = false;
    running_ = false;
    undecided_ = 0;
    on_trial_ = false;
  }

  /// One tick of `filter`, which goes on without a wheel that is found out. `spin(rates)`: what the encoders'
  /// rates say about the spin less what the gyro says, rad/s.
  template <class Input, class Spin>
  void step(Filter& filter, const Input& u, const Sample& z, Spin&& spin) noexcept {
    ++ticks_;
    watch(z, spin);
    if (lost_ >= 0) {
      step_without(filter, lost_, u, z);
      if (on_trial_) try_others(filter, u, z);
      return;
    }
    if (!running_ && suspicious()) start(filter);
    filter.predict(u);
    filter.update(z);
    follow(mean_[Wheels], filter, -1);
    if (!running_) return;
    for (int i = 0; i < Wheels; ++i) step_without(bank_[static_cast<std::size_t>(i)], i, u, z);
    judge(filter, z);
    quiet_ = suspicious() ? kQuietTicks : quiet_ - 1;
    running_ = running_ && quiet_ > 0;
  }

  /// The wheel whose encoder is not used any more; -1: none.
  int lost() const noexcept { return lost_; }
  /// It stood still when it was found out; else it counted wrongly.
  bool stood_still() const noexcept { return stood_still_; }
  /// And still does: no other sensor can make it look so.
  bool stands_still() const noexcept {
    return lost_ >= 0 && still_[static_cast<std::size_t>(lost_)] >= kStillTicks;
  }
  /// So soon after arming that the robot had better not run without it.
  bool while_arming() const noexcept { return lost_ >= 0 && lost_at_ <= kArmingTicks; }
  /// Just armed: a lying encoder surprises the estimator before it can be named.
  bool checking() const noexcept { return ticks_ <= kTrialTicks && lost_ < 0; }
  /// Filters that the next step will run, unless suspicion begins or ends with it.
  int filters() const noexcept {
    if (lost_ >= 0) return on_trial_ ? Wheels : 1;
    return running_ ? 1 + Wheels : 1;
  }
  /// An encoder explains what surprises the filter: what it learns meanwhile is not to be judged.
  bool suspects() const noexcept {
    return running_ && mean_[Wheels] > kSurprised &&
           *std::min_element(mean_.begin(), mean_.begin() + Wheels) < kExplains * mean_[Wheels];
  }
  /// Smoothed spin of the wheels against the gyro.
  double slip_rad_s() const noexcept { return slip_; }
  /// The same, where it is more than an encoder's error and all wheels stand still; else zero.
  double held_slip_rad_s() const noexcept {
    const bool held =
        std::abs(slip_) > kSlip_rad_s && *std::min_element(still_.begin(), still_.end()) >= kStillTicks;
    return held ? slip_ : 0.0;
  }

 private:
  static constexpr std::size_t kMeans = static_cast<std::size_t>(Wheels) + 1;  // the last: with all wheels
  static constexpr int kFirstTick = 5;
  static constexpr int kTrialTicks = 80;
  static constexpr int kQuietTicks = 100;
  static constexpr int kHits = 3;  // ticks in a row
  static constexpr int kStillTicks = 6;
  static constexpr double kMean = 0.2;  // of the squared innovations: five ticks
  static constexpr double kSlipMean = 0.15;
  static constexpr double kForgets = 0.02;    // of the angle: 50 ticks
  static constexpr double kLargest = 100.0;   // one outlier decides nothing
  static constexpr double kSlip_rad_s = 0.3;  // pushes do not enter it
  static constexpr double kSurprised = 1.0;   // mean of the filter with all wheels
  static constexpr double kSuspicious = 0.5;
  static constexpr double kExplains = 0.25;  // of the surprise is left without the wheel
  static constexpr double kExplainsStill = 0.8;
  static constexpr double kTurning_rad_s = 1.5;
  static constexpr double kBeyondPlay = 1.5;
  static constexpr double kLostTrack = 10.0;  // mean of the filter with all wheels
  static constexpr double kAnyExplains = 0.1;
  static constexpr int kUndecided = 10;         // ticks in a row
  static constexpr double kExplainsMore = 0.5;  // of the surprise is left without another wheel instead
  static constexpr int kRefuted = 60;  // ticks in a row; at 20 4 of 123 trials ended with the wrong wheel
  static constexpr int kMostSwaps = 4;

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
    turning_rad_s_.setZero();
    hits_ = 0;
    running_ = true;
  }

  template <class Spin>
  void watch(const Sample& z, Spin&& spin) noexcept {
    if (!z.encoders_ok || !z.imu_ok || !z.gyro_axis_ok[2] || z.ticks > 1) {
      known_ = false;
      if (!z.gyro_axis_ok[2]) slip_ = 0.0;  // what it said before may have been false already
      return;
    }
    if (known_) {
      const Vec<Wheels> moved = z.wheel_angle_rad - angle_rad_;
      const double slip = spin(Vec<Wheels>(moved / kTickS));
      slip_ += kSlipMean * (slip - slip_);
      slipped_rad_ += kTickS * slip - kForgets * slipped_rad_;
      for (int i = 0; i < Wheels; ++i) {
        const auto k = static_cast<std::size_t>(i);
        still_[k] = moved(i) == 0.0 ? still_[k] + 1 : 0;
        slipped_still_rad_[k] = still_[k] > 0 ? slipped_still_rad_[k] + kTickS * slip : 0.0;
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

  template <class Input>
  void step_without(Filter& filter, int wheel, const Input& u, const Sample& z) noexcept {
    Sample rest = z;
    rest.wheel_ok[static_cast<std::size_t>(wheel)] = false;
    filter.predict(u);
    filter.update(rest);
    follow(mean_[static_cast<std::size_t>(wheel)], filter, wheel);
  }

  void judge(Filter& filter, const Sample& z) noexcept {
    turning_rad_s_ += kMean * (z.wheel_rate_rad_s.cwiseAbs() - turning_rad_s_);
    if (ticks_ < kFirstTick) return;
    const double all = mean_[Wheels];
    int best = -1;
    if (std::abs(slip_) > kSlip_rad_s && std::abs(slipped_rad_) > play_rad_ && all > kSurprised) {
      const auto end = mean_.begin() + Wheels;
      const auto least = std::min_element(mean_.begin(), end);
      double second = kLargest;
      for (auto m = mean_.begin(); m != end; ++m) second = m == least ? second : std::min(second, *m);
      if (*least < kExplains * std::min(all, second)) best = static_cast<int>(least - mean_.begin());
      const Vec<Wheels> rate = filter.wheel_rate_rad_s();
      // Where friction holds all of them, a gyro that lies about the spin makes one look stuck.
      const bool others_turn = turning_rad_s_.maxCoeff() > kTurning_rad_s;
      for (int i = 0; i < Wheels && best < 0 && others_turn; ++i) {
        const auto k = static_cast<std::size_t>(i);
        const bool turning = std::abs(rate(i)) > kTurning_rad_s;
        if (still_[k] >= kStillTicks && turning && mean_[k] < kExplainsStill * all && mean_[k] == *least)
          best = i;
      }
    }
    // A robot that hardly moves shows it slowly: one stands still while the others turn further than play
    // lets them.
    for (int i = 0; i < Wheels && best < 0 && play_rad_ > 0.0; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (std::abs(slipped_still_rad_[k]) > kBeyondPlay * play_rad_ && mean_[k] < kExplains * all) best = i;
    }
    hits_ = best >= 0 ? hits_ + 1 : 0;
    if (hits_ >= kHits) {
      leave_out(filter, best);
      return;
    }
    const auto [least, most] = std::minmax_element(mean_.begin(), mean_.begin() + Wheels);
    undecided_ = all > kLostTrack && *most < kAnyExplains * all ? undecided_ + 1 : 0;
    // Without the gyro's yaw rate the robot needs all wheels to know its own.
    if (undecided_ < kUndecided || ticks_ <= kArmingTicks || !z.gyro_axis_ok[2]) return;
    const auto stillest = std::max_element(still_.begin(), still_.end());
    const bool one_stands = *stillest >= kStillTicks;
    on_trial_ = true;
    refuted_ = swaps_ = 0;
    leave_out(filter, static_cast<int>(one_stands ? stillest - still_.begin() : least - mean_.begin()));
  }

  void leave_out(Filter& filter, int wheel) noexcept {
    lost_ = wheel;
    lost_at_ = ticks_;
    hits_ = 0;
    stood_still_ = still_[static_cast<std::size_t>(wheel)] >= kHits;
    filter = bank_[static_cast<std::size_t>(wheel)];
    running_ = false;
  }

  /// Another wheel instead of the one that is left out, until none would explain more.
  template <class Input>
  void try_others(Filter& filter, const Input& u, const Sample& z) noexcept {
    const auto lost = static_cast<std::size_t>(lost_);
    std::size_t best = lost == 0 ? 1 : 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(Wheels); ++i) {
      if (i == lost) continue;
      step_without(bank_[i], static_cast<int>(i), u, z);
      if (mean_[i] < mean_[best]) best = i;
    }
    const bool more = mean_[lost] > kSurprised && mean_[best] < kExplainsMore * mean_[lost];
    const bool refuted = mean_[best] > kSurprised && mean_[lost] < kExplains * mean_[best];
    hits_ = more ? hits_ + 1 : 0;
    refuted_ = refuted ? refuted_ + 1 : 0;
    if (hits_ >= kHits) {
      bank_[lost] = filter;
      leave_out(filter, static_cast<int>(best));
      ++swaps_;
    }
    on_trial_ = refuted_ < kRefuted && swaps_ < kMostSwaps;
  }

  std::array<Filter, static_cast<std::size_t>(Wheels)> bank_;
  std::array<double, kMeans> mean_{};
  std::array<int, static_cast<std::size_t>(Wheels)> still_{};
  std::array<double, static_cast<std::size_t>(Wheels)> slipped_still_rad_{};  // since it stands still
  Vec<Wheels> turning_rad_s_ = Vec<Wheels>::Zero();  // of late, by the encoders, either way
  Vec<Wheels> angle_rad_ = Vec<Wheels>::Zero();
  bool known_ = false;
  double play_rad_;
  double slip_ = 0.0;
  double slipped_rad_ = 0.0;  // of late
  int ticks_ = 0;             // since arming
  int quiet_ = kArmingTicks;
  int hits_ = 0;
  int lost_ = -1;
  int lost_at_ = 0;
  bool stood_still_ = false;
  bool running_ = false;
  int undecided_ = 0;  // ticks in a row
  bool on_trial_ = false;
  int refuted_ = 0;  // ticks in a row
  int swaps_ = 0;
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
