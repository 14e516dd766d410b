// Do the encoders show what the motors do? Right after arming each wheel in turn is shaken for 80 ms; its
// encoder must follow.
// In: armed, duties at the wheels since the last tick, encoder angles -> out: a drive to add; faults(): per
// wheel, stuck or reversed. The verdict on the last wheel falls kTicks after arming; from then on, and
// disarmed, nothing is added. Motor and encoder share a shaft, so this holds for any robot and any
// controller. Shape, lag and limits were chosen on runs of both robots in the nominal world: a sound
// encoder correlates above 0.85 with what is expected, a reversed one below -0.85. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "equipoise/types.hpp"

namespace equipoise {

struct EncoderFaults {
  std::uint32_t stuck = 0;  // bit per wheel
  std::uint32_t reversed = 0;
};

template <int N>
class EncoderCheck {
 public:
  static constexpr int kShake = 16;           // ticks: 2 forth, 4 back, 4 forth, 4 back, 2 forth
  static constexpr int kWindow = kShake + 2;  // and the answer to the last
  static constexpr int kTicks = N * kWindow;  // 0.18 s of two wheels, 0.27 s of three

  /// `drive`: of full duty, more than friction takes, less than throws the robot; 0: no check.
  explicit EncoderCheck(double drive) : drive_(drive) {}

  bool running() const noexcept { return tick_ >= 0 && tick_ < kTicks; }

  const EncoderFaults& faults() const noexcept { return faults_; }

  /// What to add to the wheels' drives in this tick.
  Vec<N> update(bool armed, const Vec<N>& duty, const Vec<N>& angle_rad) noexcept {
    observe(armed, duty, angle_rad);
    Vec<N> drive = Vec<N>::Zero();
    if (running()) drive(tick_ / kWindow) = drive_ * sense(tick_ % kWindow);
    return drive;
  }

 private:
  using Samples = std::array<double, static_cast<std::size_t>(kWindow)>;

  void observe(bool armed, const Vec<N>& duty, const Vec<N>& angle_rad) noexcept {
    if (!armed || !(drive_ > 0.0)) {
      tick_ = -1;
      faults_ = {};
      speed_.setZero();
      travel_.setZero();
      return;
    }
    if (tick_ >= kTicks) return;
    // A wheel with inertia under the drive: the answer's shape is what counts, its size is not known.
    travel_ += speed_ + 0.5 * duty;
    speed_ = kLag * (speed_ + duty);
    if (tick_ >= 0) {
      const auto sample = static_cast<std::size_t>(tick_ % kWindow);
      for (int wheel = 0; wheel < N; ++wheel) {
        auto& [angle, expected] = seen_[static_cast<std::size_t>(wheel)];
        angle[sample] = angle_rad(wheel);
        expected[sample] = travel_(wheel);
        if (sample + 1 == angle.size()) judge(wheel, wheel == tick_ / kWindow);
      }
    }
    ++tick_;
  }

  static double sense(int tick) noexcept {
    if (tick >= kShake) return 0.0;
    return (tick + 2) / 4 % 2 == 0 ? 1.0 : -1.0;
  }

  /// A wheel that is not shaken is judged where its controller, misled by it, has driven it as hard.
  void judge(int wheel, bool shaken) noexcept {
    auto& [angle, expected] = seen_[static_cast<std::size_t>(wheel)];
    const auto [low, high] = std::minmax_element(angle.begin(), angle.end());
    if (shaken && *high - *low < kStuckTravel_rad) {
      faults_.stuck |= 1U << wheel;
      return;
    }
    remove_drift(angle);
    remove_drift(expected);
    const double driven = std::sqrt(dot(expected, expected));
    if (!shaken && driven < kAsHard * drive_) return;
    const double against = shaken ? kAgainst : kAgainstUnshaken;
    if (dot(angle, expected) < -against * driven * std::sqrt(dot(angle, angle)))
      faults_.reversed |= 1U << wheel;
  }

  static double dot(const Samples& a, const Samples& b) noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }

  /// Takes out the least-squares cubic, which is what balancing does meanwhile.
  static void remove_drift(Samples& samples) noexcept {
    std::array<Samples, 4> basis{};  // of polynomials, orthogonal by Gram-Schmidt
    for (std::size_t degree = 0; degree < basis.size(); ++degree) {
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const double t = 2.0 * static_cast<double>(i) / (kWindow - 1) - 1.0;
        basis[degree][i] = degree == 0 ? 1.0 : t * basis[degree - 1][i];
      }
      for (std::size_t lower = 0; lower < degree; ++lower) subtract(basis[degree], basis[lower]);
      subtract(samples, basis[degree]);
    }
  }
  static void subtract(Samples& samples, const Samples& direction) noexcept {
    const double share = dot(samples, direction) / dot(direction, direction);
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i] -= share * direction[i];
  }

  static constexpr double kLag = 0.7;  // of a wheel's speed left after a tick
  static constexpr double kStuckTravel_rad = 0.01;
  static constexpr double kAgainst = 0.6;           // correlation
  static constexpr double kAgainstUnshaken = 0.85;  // at 0.6, 2 of 2620 sound starts were refused (soak)
  static constexpr double kAsHard = 7.0;            // root of the sum of squares, per drive; shaken: 10

  double drive_;
  int tick_ = -1;  // of the check, counted from the first armed tick
  Vec<N> speed_ = Vec<N>::Zero();
  Vec<N> travel_ = Vec<N>::Zero();
  std::array<std::pair<Samples, Samples>, static_cast<std::size_t>(N)> seen_{};  // angle, expected
  EncoderFaults faults_;
};

}  // namespace equipoise
