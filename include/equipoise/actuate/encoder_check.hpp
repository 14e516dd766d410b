// Do the encoders show what the motors do? Right after arming each wheel in turn is shaken for 60 ms, forth,
// back and forth, which moves the robot nowhere; its encoder must follow.
// In: armed, encoder angles -> out: a drive to add at the wheels; per wheel, stuck or reversed. Verdicts fall
// before kTicks; afterwards, and disarmed, nothing is added. Motor and encoder are on one shaft: that it
// follows holds for any robot and any controller. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
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
  static constexpr int kStroke = 3;           // ticks forth, twice as many back, as many forth
  static constexpr int kShake = 4 * kStroke;  // 60 ms
  static constexpr int kWindow = kShake + 4;  // and the answer to its last tick
  static constexpr int kTicks = N * kWindow;  // after arming: 0.16 s of two wheels, 0.24 s of three

  /// `drive`: of full duty, more than friction takes, less than throws the robot; 0: no check.
  explicit EncoderCheck(double drive) : drive_(drive), answer_(expected_answer()) {}

  /// What to add to the wheels' drives in this tick.
  Vec<N> drive() const noexcept {
    Vec<N> drive = Vec<N>::Zero();
    if (running_) drive(tick_ / kWindow) = drive_ * sense(tick_ % kWindow);
    return drive;
  }

  EncoderFaults update(bool armed, const Vec<N>& angle_rad) noexcept {
    if (!armed || !(drive_ > 0.0)) {
      running_ = false;
      tick_ = -1;
      faults_ = {};
      return faults_;
    }
    if (tick_ + 1 > kTicks) return faults_;
    ++tick_;
    if (tick_ > 0) {
      const int wheel = (tick_ - 1) / kWindow;
      const int sample = (tick_ - 1) % kWindow;
      angles_[static_cast<std::size_t>(sample)] = angle_rad(wheel);
      if (sample == kWindow - 1) judge(wheel);
    }
    running_ = tick_ < kTicks;
    return faults_;
  }

 private:
  using Samples = std::array<double, static_cast<std::size_t>(kWindow)>;

  static double sense(int tick) noexcept {
    if (tick >= kShake) return 0.0;
    return tick < kStroke || tick >= 3 * kStroke ? 1.0 : -1.0;
  }

  void judge(int wheel) noexcept {
    Samples moved = angles_;
    remove_drift(moved);
    const auto [low, high] = std::minmax_element(angles_.begin(), angles_.end());
    const double alike = dot(moved, answer_) / std::sqrt(dot(moved, moved) * dot(answer_, answer_) + 1e-300);
    if (*high - *low < kStuckTravel_rad) {
      faults_.stuck |= 1U << wheel;
    } else if (alike < -kAgainst) {
      faults_.reversed |= 1U << wheel;
    }
  }

  /// Angle of a wheel with inertia under the drive, without what a balancing robot does meanwhile.
  static Samples expected_answer() noexcept {
    Samples angle{};
    double speed = 0.0;
    double travelled = 0.0;
    for (int i = 0; i < kWindow; ++i) {
      angle[static_cast<std::size_t>(i)] = travelled;
      travelled += speed;
      speed += sense(i);
    }
    remove_drift(angle);
    return angle;
  }

  static double dot(const Samples& a, const Samples& b) noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }

  /// Takes out the least-squares cubic: two steps of Gram-Schmidt per degree.
  static void remove_drift(Samples& samples) noexcept {
    std::array<Samples, 4> basis{};
    for (std::size_t degree = 0; degree < basis.size(); ++degree) {
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const double t = 2.0 * static_cast<double>(i) / (kWindow - 1) - 1.0;
        basis[degree][i] = std::pow(t, static_cast<int>(degree));
      }
      for (std::size_t lower = 0; lower < degree; ++lower) subtract(basis[degree], basis[lower]);
      subtract(samples, basis[degree]);
    }
  }
  static void subtract(Samples& samples, const Samples& direction) noexcept {
    const double share = dot(samples, direction) / dot(direction, direction);
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i] -= share * direction[i];
  }

  static constexpr double kStuckTravel_rad = 0.02;
  static constexpr double kAgainst = 0.5;  // correlation

  double drive_;
  Samples answer_;
  Samples angles_{};
  bool running_ = false;
  int tick_ = -1;
  EncoderFaults faults_;
};

}  // namespace equipoise
