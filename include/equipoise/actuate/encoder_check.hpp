// Do the encoders show what the motors do? Watched over the first half second after arming.
// In: armed, duties at the wheels, encoder angles and rates -> out: per wheel, stuck or reversed. A wheel
// that is driven beyond friction must move; its rate must change with its duty, not against it: wheels and
// motors are collocated, so this holds for any robot and any controller. RT-safe.
#pragma once

#include <array>
#include <cstdint>

#include "equipoise/types.hpp"

namespace equipoise {

struct EncoderFaults {
  std::uint32_t stuck = 0;  // bit per wheel
  std::uint32_t reversed = 0;
};

template <int N>
class EncoderCheck {
 public:
  static constexpr int kWindow = 100;  // ticks, 0.5 s

  EncoderFaults update(bool armed, const Vec<N>& duty, const Vec<N>& angle_rad,
                       const Vec<N>& rate_rad_s) noexcept {
    if (!armed) {
      *this = EncoderCheck{};
      angle_previous_ = angle_rad;
      return {};
    }
    if (ticks_ >= kWindow || !duty.allFinite() || !angle_rad.allFinite()) return {};
    ++ticks_;
    for (std::size_t i = kHistory - 1; i > 0; --i) {
      duties_[i] = duties_[i - 1];
      rates_[i] = rates_[i - 1];
    }
    duties_[0] = duty;
    rates_[0] = rate_rad_s;
    travel_ += (angle_rad - angle_previous_).cwiseAbs();
    angle_previous_ = angle_rad;
    effort_ += (duty.cwiseAbs().array() - kBreakaway).cwiseMax(0.0).matrix();
    if (ticks_ > static_cast<int>(kHistory)) correlate();

    EncoderFaults faults;
    for (int i = 0; i < N; ++i) {
      if (effort_(i) > kStuckEffort && travel_(i) < kStuckTravel_rad) faults.stuck |= 1U << i;
      if (ticks_ >= kFirstVerdict &&
          both_(i) < -kAgainst * std::sqrt(duty_squared_(i) * change_squared_(i)) &&
          duty_squared_(i) > kEnoughDuty * kEnoughDuty &&
          change_squared_(i) > kEnoughChange * kEnoughChange) {
        faults.reversed |= 1U << i;
      }
    }
    return faults;
  }

 private:
  /// A rate is the slope over six samples, 2.5 ticks old: the change of the last five ticks answers the
  /// duties of ticks 8 to 3 ago.
  void correlate() noexcept {
    const Vec<N> change = rates_[0] - rates_[5];
    const Vec<N> push =
        0.5 * duties_[7] + duties_[6] + duties_[5] + duties_[4] + duties_[3] + 0.5 * duties_[2];
    both_ += change.cwiseProduct(push);
    duty_squared_ += push.cwiseProduct(push);
    change_squared_ += change.cwiseProduct(change);
  }

  static constexpr std::size_t kHistory = 9;
  static constexpr double kBreakaway = 0.15;   // duty that overcomes any healthy gear's friction
  static constexpr double kStuckEffort = 1.0;  // duty beyond it, times ticks
  static constexpr double kStuckTravel_rad = 0.02;
  static constexpr int kFirstVerdict = 60;
  static constexpr double kAgainst = 0.6;       // correlation
  static constexpr double kEnoughDuty = 1.5;    // root of the sum of squares
  static constexpr double kEnoughChange = 5.0;  // rad/s

  int ticks_ = 0;
  std::array<Vec<N>, kHistory> duties_ = filled();
  std::array<Vec<N>, kHistory> rates_ = filled();
  Vec<N> angle_previous_ = Vec<N>::Zero();
  Vec<N> travel_ = Vec<N>::Zero();
  Vec<N> effort_ = Vec<N>::Zero();
  Vec<N> both_ = Vec<N>::Zero();
  Vec<N> duty_squared_ = Vec<N>::Zero();
  Vec<N> change_squared_ = Vec<N>::Zero();

  static std::array<Vec<N>, kHistory> filled() noexcept {
    std::array<Vec<N>, kHistory> zeros;
    zeros.fill(Vec<N>::Zero());
    return zeros;
  }
};

}  // namespace equipoise
